"""Curves of learning: losses over iterations, errors over training pushes."""

from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.ticker import (
    FixedLocator,
    FuncFormatter,
    LogLocator,
    MaxNLocator,
    NullLocator,
)
from scipy.ndimage import uniform_filter1d

from sainet.evaluation.summary import Estimate, Row, Summary
from sainet.learning.log import LogLine
from sainet.report.figures import canvas
from sainet.report.palette import INK, ModelStyle, styles_of

History = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]

_WINDOW = 0.1  # fraction of the logged losses in a mean
# The style of each kind of line.
_BATCH = canvas.LineLook(linewidth=0.7, alpha=0.45)
_MEAN = canvas.LineLook(linewidth=1.6)
_VALIDATION = canvas.LineLook(linestyle=":", marker="o", markersize=3)


def draw_learning_curve(histories: Mapping[str, History], path: Path) -> Path:
    """Draw the loss of batches, its running mean and the validation loss.

    Args:
        histories: by model, iterations and training loss, iterations and validation
            loss (both may be empty); losses have no unit.
        path: where to write; ``.svg`` or ``.png``.
    """
    styles = styles_of(histories)
    with canvas.house_look():
        figure = canvas.new_figure(6.4, 3.4)
        axes = figure.subplots()
        axes.set_yscale("log")
        canvas.number_ticks(axes.yaxis, LogLocator(subs=(1, 2, 5)))
        for name, history in histories.items():
            _draw_history(axes, styles[name], history)
        axes.set(xlabel="iteration", ylabel="loss", title="Learning")
        axes.xaxis.set_major_locator(MaxNLocator(6, integer=True))
        axes.margins(x=0.02)
        canvas.add_grid(axes)
        _explain_lines(axes, histories)
        figure.draw_without_rendering()
        ends = {name: _last_loss(history) for name, history in histories.items()}
        known = {name: end for name, end in ends.items() if end is not None}
        canvas.label_ends(axes, [styles[name] for name in known], [*known.values()])
        return canvas.save(figure, path)


def running_mean(losses: Float[np.ndarray, " logged"]) -> Float[np.ndarray, " logged"]:
    """Return the running mean of noisy batch losses."""
    window = max(int(_WINDOW * len(losses)), 1)
    return uniform_filter1d(losses, window, mode="nearest")


def _draw_history(axes: Axes, style: ModelStyle, history: History) -> None:
    iterations, training, checked, validation = map(np.asarray, history)
    axes.plot(iterations, training, **_BATCH | {"color": style.color})
    axes.plot(iterations, running_mean(training), **_MEAN | {"color": style.color})
    axes.plot(checked, validation, **_VALIDATION | {"color": style.color})


def _explain_lines(axes: Axes, histories: Mapping[str, History]) -> None:
    kinds = {"training, each batch": _BATCH, "training, running mean": _MEAN}
    if any(len(validation) for *_, validation in histories.values()):
        kinds["validation"] = _VALIDATION
    handles = [
        Line2D([], [], label=name, **look | {"color": INK})
        for name, look in kinds.items()
    ]
    axes.legend(handles=handles, loc="upper right")


def _last_loss(history: History) -> tuple[float, float] | None:
    """Return the end of a model's curve: validation, else mean training loss."""
    iterations, training, checked, validation = map(np.asarray, history)
    if len(validation):
        return float(checked[-1]), float(validation[-1])
    if len(training):
        return float(iterations[-1]), float(running_mean(training)[-1])
    return None


def draw_history(model: str, log: Sequence[LogLine], path: Path) -> Path:
    """Draw the loss of training and, where it was measured, of validation.

    Args:
        model: slug of the network, whose label stands beside the curve. Equal logs of
            one model give the same bytes, whatever folder the training wrote.
        log: the lines of the training log.
        path: file to write; ``.svg`` or ``.png``.
    """
    checked = [line for line in log if line.validation_loss is not None]
    history = (
        np.array([line.iteration for line in log]),
        np.array([line.loss for line in log]),
        np.array([line.iteration for line in checked]),
        np.array([line.validation_loss for line in checked]),
    )
    return draw_learning_curve({model: history}, path)


FACTOR = "training_pushes"
METRICS = {"pos_mm": "position error (mm)", "rot_deg": "rotation error (deg)"}
_TICKS = (0.2, 0.3, 0.5, 0.7, 1, 1.5, 2, 3, 5, 7, 10, 15, 20)  # mm or degrees
# Ratios: of sizes whose labels do not touch; of errors on a logarithmic scale.
_APART, _WIDE = 1.6, 4


class _Row(NamedTuple):
    """The errors of one model on one disk after training on so many pushes."""

    pushes: int
    row: Row


def draw_data_efficiency(summary: Summary, path: Path) -> Path:
    """Draw each model's mean errors over the pushes that it was trained on.

    Of position and rotation, a panel for each disk. Bands are 95 % intervals. A model
    that does not depend on them, such as physics, becomes a level line.

    Args:
        summary: of conditions that differ in the number of training pushes and in
            nothing else; others are left out.
        path: where to write; ``.svg`` or ``.png``.
    """
    sizes = {
        condition.label: int(condition.factors[FACTOR])
        for condition in summary.conditions
        if condition.factors.keys() == {FACTOR}
    }
    rows = [_Row(sizes[r.condition], r) for r in summary.rows if r.condition in sizes]
    # Where only the ends of pushes were observed, no mean over a push is another.
    means = ((row.values, m) for _, row in rows for m in METRICS)
    ends = all(v.get(m) in (None, v.get(f"final_{m}")) for v, m in means)
    end = "final " if ends else ""
    styles = styles_of((each.row.model for each in rows), summary.models)
    bodies = sorted({each.row.body for each in rows})
    cases = [(metric, body) for metric in METRICS for body in bodies]
    down, across = (1, 2) if len(bodies) == 1 else (2, len(bodies))
    with canvas.house_look():
        figure = canvas.new_figure(1.4 + 4.1 * across, 3.3 * down)
        panels = list(figure.subplots(down, across).flat)
        for (metric, body), axes in zip(cases, panels, strict=True):
            _set_axes(axes, sorted(sizes.values()))
            axes.set_title(f"Disk {body}")
            axes.set_ylabel(f"mean {end}{METRICS[metric]}")
            for name, style in styles.items():
                _draw_model(axes, style, _of(rows, name, body), metric)
            _set_scale(axes)
        figure.draw_without_rendering()
        for (metric, body), axes in zip(cases, panels, strict=True):
            ends = [_end(_of(rows, name, body), metric) for name in styles]
            canvas.label_ends(axes, list(styles.values()), ends)
        return canvas.save(figure, path)


def _of(rows: list[_Row], model: str, body: int) -> list[_Row]:
    """Return the rows of one line, from few pushes to many."""
    found = [each for each in rows if (each.row.model, each.row.body) == (model, body)]
    return sorted(found, key=lambda each: each.pushes)


def _end(rows: list[_Row], metric: str) -> tuple[float, float]:
    last = rows[-1]
    return last.pushes, estimate_of(last.row, metric).value or 0.0


def estimate_of(row: Row, metric: str) -> Estimate:
    """Return the mean over a push; the error of its end where only that is known."""
    return row.values.get(metric) or row.values[f"final_{metric}"]


def _draw_model(axes: Axes, style: ModelStyle, rows: list[_Row], metric: str) -> None:
    pushes = [each.pushes for each in rows]
    found = [estimate_of(each.row, metric) for each in rows]
    error, low, high = np.array([(e.value, e.low, e.high) for e in found], float).T
    learns = np.ptp(error) > 0
    look = canvas.line_look(style, 1.6 if learns else 1.0)
    if learns:
        look |= canvas.LineLook(marker="o", markersize=3.5)
    axes.plot(pushes, error, **look)
    if learns:
        axes.fill_between(pushes, low, high, alpha=0.16, color=style.color, linewidth=0)


def _set_axes(axes: Axes, sizes: list[int]) -> None:
    axes.set_xscale("log")
    axes.set_xlabel("training pushes")
    axes.xaxis.set_major_locator(FixedLocator(sizes))
    # Two labels that are close would touch: the last one is written.
    apart = {a for a, b in pairwise([*sizes, np.inf]) if b > _APART * a}
    label = FuncFormatter(lambda x, _: f"{x:,.0f}" if round(x) in apart else "")
    axes.xaxis.set_major_formatter(label)
    axes.xaxis.set_minor_locator(NullLocator())
    canvas.add_grid(axes)


def _set_scale(axes: Axes) -> None:
    """Make the scale of the errors logarithmic where they span that much."""
    if axes.dataLim.y1 < _WIDE * axes.dataLim.y0:
        return
    axes.set_yscale("log")
    canvas.number_ticks(axes.yaxis, FixedLocator(_TICKS))
