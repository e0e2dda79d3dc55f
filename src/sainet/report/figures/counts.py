"""Errors over the number of disks, an arrangement in each column."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import FixedLocator, NullLocator

from sainet.evaluation.summary import Summary
from sainet.report.figures import canvas
from sainet.report.figures.curves import METRICS
from sainet.report.palette import styles_of

_TICKS = (0.1, 0.2, 0.5, 1, 2, 5, 10)  # mm or degrees

Line = list[tuple[int, float]]  # number of disks, and error


def draw_errors_over_disks(summary: Summary, path: Path) -> Path:
    """Draw each model's error, the mean of all disks, over the number of disks.

    Args:
        summary: of conditions with the factors ``disks`` and ``arrangement``; two disks
            have one arrangement, and stand in every column.
        path: where to write; ``.svg`` or ``.png``.
    """
    found = sorted({str(each.factors["arrangement"]) for each in summary.conditions})
    styles = styles_of((row.model for row in summary.rows), summary.models)
    with canvas.house_look():
        figure = canvas.new_figure(1.6 + 3.1 * len(found), 5.6)
        panels = figure.subplots(2, len(found), sharex=True, sharey="row")
        for (metric, label), row in zip(METRICS.items(), panels, strict=True):
            row[0].set_ylabel(f"mean {label}")
            for arrangement, axes in zip(found, row, strict=True):
                lines = _lines(summary, list(styles), arrangement, metric)
                for name, line in lines.items():
                    look = canvas.line_look(styles[name])
                    look |= canvas.LineLook(marker="o", markersize=3.5)
                    axes.plot(*zip(*line, strict=True), **look)
                _set_axes(axes, lines)
        for arrangement, axes in zip(found, panels[0], strict=True):
            axes.set_title(f"{arrangement}s".capitalize())
        for axes in panels[1]:
            axes.set_xlabel("disks")
        names = [style.label for style in styles.values()]
        lines = panels[0][0].get_lines()
        figure.legend(lines, names, loc="outside lower center", ncols=3)
        return canvas.save(figure, path)


def _lines(
    summary: Summary, models: list[str], arrangement: str, metric: str
) -> Mapping[str, Line]:
    """Return the errors of each model in an arrangement, from few disks to many."""
    fewest = min(int(each.factors["disks"]) for each in summary.conditions)
    places = sorted(
        (int(each.factors["disks"]), each.label)
        for each in summary.conditions
        if each.factors["disks"] == fewest or each.factors["arrangement"] == arrangement
    )
    return {
        model: [
            (disks, float(np.mean(errors)))
            for disks, label in places
            if (errors := summary.errors(model, metric, label))
        ]
        for model in models
    }


def _set_axes(axes: Axes, lines: Mapping[str, Line]) -> None:
    axes.set_xscale("log")
    axes.set_yscale("log")
    counts = sorted({disks for line in lines.values() for disks, _ in line})
    canvas.number_ticks(axes.xaxis, FixedLocator(counts))
    canvas.number_ticks(axes.yaxis, FixedLocator(_TICKS))
    axes.xaxis.set_minor_locator(NullLocator())
    canvas.add_grid(axes)
