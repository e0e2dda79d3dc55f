"""Errors of engines on recorded pushes, by position on the table and heading."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes

from sainet.evaluation.predictions import EndOffsets
from sainet.report.figures.canvas import add_grid, house_look, new_figure, save
from sainet.report.palette import INK, MOVED, PUSHED

_CELL = 20.0  # mm, of the table
_FEWEST = 4  # pushes of a mean that is drawn
_ARROW = 8.0  # times its true length
_SECTORS = 12  # of headings
_SHOWN = 2.0  # mm, length of the scale arrow


def draw_engine_errors(cases: Mapping[str, EndOffsets], path: Path) -> Path:
    """Draw the final errors of engines, with one row per surface and engine.

    Left: the mean vector from the predicted to the recorded final position, by the
    initial position of the disk. Right: this vector along the push and to its left,
    over the heading of the push; bands are two standard errors. An engine that models
    uniform friction correctly would have no arrows and two level lines.

    Args:
        cases: errors by the name of surface and engine.
        path: where to write; ``.svg`` or ``.png``.
    """
    with house_look():
        figure = new_figure(8.2, 0.3 + 3.0 * len(cases))
        panels = figure.subplots(
            len(cases), 2, squeeze=False, width_ratios=(1, 1.25), sharex="col"
        )
        for (name, case), (table, direction) in zip(cases.items(), panels, strict=True):
            _draw_table(table, case)
            table.set_title(f"{name}: where on the table")
            direction.sharey(panels[0][1])
            _draw_directions(direction, case)
            direction.set_title(f"{name}: in which direction")
        panels[-1][0].set_xlabel("x of the disk (mm)")
        panels[-1][1].set_xlabel("direction of the push on the table (deg)")
        panels[0][1].legend(loc="upper right", ncols=2)
        return save(figure, path)


def _draw_table(axes: Axes, case: EndOffsets) -> None:
    place, offset = 1000 * case.place, 1000 * case.offset
    axes.plot(*place.T, ".", color=INK, alpha=0.25, markersize=2)
    cells, owner = np.unique(np.floor(place / _CELL), axis=0, return_inverse=True)
    members = [np.flatnonzero(owner.ravel() == cell) for cell in range(len(cells))]
    full = [cell for cell, rows in enumerate(members) if len(rows) >= _FEWEST]
    if full:
        means = np.array([offset[members[cell]].mean(axis=0) for cell in full])
        middles = _CELL * (cells[full] + 0.5)
        arrows = axes.quiver(
            *middles.T,
            *means.T,
            color=PUSHED,
            width=0.006,
            angles="xy",
            scale_units="xy",
            scale=1 / _ARROW,
        )
        axes.quiverkey(arrows, 0.12, 0.04, _SHOWN, f"{_SHOWN:g} mm", labelpos="E")
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_ylabel("y of the disk (mm)")


def _draw_directions(axes: Axes, case: EndOffsets) -> None:
    heading = np.rad2deg(case.heading)
    sector = np.floor((heading + 180) / (360 / _SECTORS)).astype(int) % _SECTORS
    lines = {
        "along the push": (case.along, PUSHED),
        "to its left": (case.across, MOVED),
    }
    for label, (values, color) in lines.items():
        middle, mean, error = [], [], []
        for number in range(_SECTORS):
            found = 1000 * values[sector == number]
            if len(found) >= _FEWEST:
                middle.append((number + 0.5) * 360 / _SECTORS - 180)
                mean.append(found.mean())
                error.append(2 * found.std(ddof=1) / np.sqrt(len(found)))
        low, high = np.subtract(mean, error), np.add(mean, error)
        axes.plot(middle, mean, "o-", color=color, markersize=3, label=label)
        axes.fill_between(middle, low, high, color=color, alpha=0.16, linewidth=0)
    axes.axhline(0, color=INK, linewidth=0.6)
    axes.set(xlim=(-180, 180), xticks=range(-180, 181, 90))
    axes.set_ylabel("observed minus engine (mm)")
    add_grid(axes)
