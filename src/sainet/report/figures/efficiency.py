"""The figure of data efficiency: error against the number of training pushes."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import FixedLocator, FuncFormatter, NullFormatter, NullLocator

from sainet.report.figures.canvas import (
    add_grid,
    house_look,
    label_ends,
    line_look,
    new_figure,
    save,
)
from sainet.report.palette import ModelStyle, styles_of

_Row = Mapping[str, Any]
_METRICS = {"pos_mm": "position error (mm)", "rot_deg": "rotation error (deg)"}
_WIDE = 4  # ratio of errors from which a scale is logarithmic


def draw_data_efficiency(table: Mapping[str, Any], path: Path) -> Path:
    """Draw each model's mean errors over the pushes that it was trained on.

    Of position and rotation, a panel for each disk. Bands are 95 % intervals. A model
    that is the same whatever the pushes, physics say, becomes a level line.

    Args:
        table: its rows' groups are numbers of training pushes: ``1,500``.
        path: where to write; ``.svg`` or ``.png``.
    """
    rows = list(table["rows"])
    styles = styles_of(str(row["model"]) for row in rows)
    bodies = sorted({int(row["body"]) for row in rows})
    cases = [(metric, body) for metric in _METRICS for body in bodies]
    down, across = (1, 2) if len(bodies) == 1 else (2, len(bodies))
    with house_look():
        figure = new_figure(1.4 + 4.1 * across, 3.3 * down)
        panels = list(figure.subplots(down, across).flat)
        for (metric, body), axes in zip(cases, panels, strict=True):
            _set_axes(axes, sorted({_pushes(row) for row in rows}))
            axes.set_title(f"Disk {body}")
            axes.set_ylabel(f"mean {_METRICS[metric]}")
            for name, style in styles.items():
                _draw_model(axes, style, _of(rows, name, body), metric)
            _set_scale(axes)
        figure.draw_without_rendering()
        for (metric, body), axes in zip(cases, panels, strict=True):
            ends = [_end(_of(rows, name, body), metric) for name in styles]
            label_ends(axes, list(styles.values()), ends)
        return save(figure, path)


def _pushes(row: _Row) -> int:
    return int(str(row["group"]).replace(",", ""))


def _of(rows: list[_Row], model: str, body: int) -> list[_Row]:
    """Return the rows of one line, from few pushes to many."""
    found = [row for row in rows if row["model"] == model and row["body"] == body]
    return sorted(found, key=_pushes)


def _end(rows: list[_Row], metric: str) -> tuple[float, float]:
    return _pushes(rows[-1]), float(rows[-1][metric])


def _draw_model(axes: Axes, style: ModelStyle, rows: list[_Row], metric: str) -> None:
    pushes = [_pushes(row) for row in rows]
    error = np.array([row[metric] for row in rows], float)
    low, high = np.array([row[f"{metric}_interval"] for row in rows], float).T
    learns = np.ptp(error) > 0
    marker = {"marker": "o", "markersize": 3.5} if learns else {}
    axes.plot(pushes, error, **line_look(style, 1.6 if learns else 1.0), **marker)
    if learns:
        axes.fill_between(pushes, low, high, alpha=0.16, color=style.color, linewidth=0)


def _set_axes(axes: Axes, sizes: list[int]) -> None:
    axes.set_xscale("log")
    axes.set_xlabel("training pushes")
    axes.xaxis.set_major_locator(FixedLocator(sizes))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda x, _: f"{x:,.0f}"))
    axes.xaxis.set_minor_locator(NullLocator())
    add_grid(axes)


def _set_scale(axes: Axes) -> None:
    """Make the scale of the errors logarithmic where they span that much."""
    if axes.dataLim.y1 < _WIDE * axes.dataLim.y0:
        return
    axes.set_yscale("log")
    axes.yaxis.set_major_locator(FixedLocator([0.2, 0.5, 1, 2, 5, 10, 20]))
    axes.yaxis.set_major_formatter("{x:g}")
    axes.yaxis.set_minor_formatter(NullFormatter())
