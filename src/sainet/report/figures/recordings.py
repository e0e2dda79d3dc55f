"""Figures of a dataset: its pushes on the table, and histograms."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from jaxtyping import Float, Int
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection

from sainet.datasets.facts import Facts
from sainet.report.figures import canvas
from sainet.report.palette import INK, MOVED, PUSHED

MOST_DRAWN = 400  # pushes
_MM = 1e3
_BINS = 30
_COLUMNS = 3
_DOUBT = "#8a5aa8"


def drawn_rows(pushes: int, doubtful: Sequence[int]) -> Int[np.ndarray, " some"]:
    """Return at most 400 rows, evenly spread, and as many doubtful ones."""
    spread = np.unique(np.linspace(0, pushes - 1, min(pushes, MOST_DRAWN)).astype(int))
    return np.union1d(spread, np.unique(doubtful)[:MOST_DRAWN]).astype(int)


def draw_pushes(facts: Facts, doubtful: Sequence[int], path: Path) -> Path:
    """Draw starts and ends of disks and the paths of the pusher (mm).

    Args:
        facts: of all pushes.
        doubtful: rows of the doubtful pushes, which are drawn in another colour.
        path: where to write; ``.svg`` or ``.png``.
    """
    rows = drawn_rows(len(facts.start), doubtful)
    with canvas.house_look():
        figure = canvas.new_figure(6.6, 5.4)
        axes = figure.subplots()
        bad = np.isin(rows, doubtful)
        _draw(axes, facts, rows[~bad], None)
        if bad.any():
            _draw(axes, facts, rows[bad], _DOUBT)
            axes.plot([], [], color=_DOUBT, label="doubtful")
        axes.set_aspect("equal", adjustable="datalim")
        axes.set(xlabel="x (mm)", ylabel="y (mm)")
        canvas.add_grid(axes, "both")
        figure.legend(loc="outside lower center", ncols=4)
        return canvas.save(figure, path)


def _draw(
    axes: Axes, facts: Facts, rows: Int[np.ndarray, " some"], color: str | None
) -> None:
    """Draw some pushes in one colour, or in the colours of the legend."""
    ink, first, last = (color or each for each in (INK, PUSHED, MOVED))
    width = 1.6 if color else 0.7
    before, after = facts.start[rows, :, :2], facts.end[rows, :, :2]
    travels = np.stack([before, after], axis=-2).reshape(-1, 2, 2)
    travels = travels[np.isfinite(travels).all(axis=(1, 2))]
    names = (
        ("", "", "") if color else ("pusher", "disk at the start", "disk at the end")
    )
    for lines, look, alpha in ((facts.path[rows], ink, 0.4), (travels, last, 0.25)):
        paths = LineCollection(list(_MM * lines), colors=look, linewidths=width)
        paths.set(alpha=1.0 if color else alpha, zorder=3 if color else 1)
        axes.add_collection(paths)
    x, y = _points(facts.path[rows, :1])
    axes.plot(x, y, "o", color=ink, ms=1.8, mew=0, label=names[0])
    x, y = _points(before)
    axes.plot(x, y, "o", color=first, ms=2.8, mfc="none", mew=0.7, label=names[1])
    x, y = _points(after)
    axes.plot(x, y, "o", color=last, ms=2.4, mew=0, label=names[2])


def _points(place: Float[np.ndarray, "push body 2"]) -> Float[np.ndarray, "2 n"]:
    points = _MM * place.reshape(-1, 2)
    return points[np.isfinite(points).all(axis=1)].T


def draw_histograms(
    quantities: Mapping[str, tuple[str, Float[np.ndarray, " _"]]], path: Path
) -> Path:
    """Draw a histogram of each quantity that varies.

    Args:
        quantities: unit and values by name, as `inspection.quantities_of` returns them.
        path: where to write; ``.svg`` or ``.png``.
    """
    finite = {
        f"{name} ({unit})" if unit else name: values[np.isfinite(values)]
        for name, (unit, values) in quantities.items()
    }
    # Less than this tolerance is rounding.
    varied = {
        n: v for n, v in finite.items() if not np.allclose(v, v[:1], 1e-4, 1e-4)
    } or finite
    rows = -(-len(varied) // _COLUMNS)
    with canvas.house_look():
        figure = canvas.new_figure(7.8, 1.85 * rows)
        panels = figure.subplots(rows, _COLUMNS, squeeze=False).ravel()
        for axes, (name, values) in zip(panels, varied.items(), strict=False):
            axes.hist(values, bins=_BINS, color=MOVED)
            axes.set_xlabel(name)
            axes.ticklabel_format(useOffset=False)
            axes.locator_params(axis="x", nbins=4)
            canvas.add_grid(axes)
        for axes in panels[len(varied) :]:
            axes.set_axis_off()
        for axes in panels[::_COLUMNS]:
            axes.set_ylabel("number")
        return canvas.save(figure, path)
