"""The learning curve of a network."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.ticker import LogLocator, MaxNLocator, NullFormatter
from scipy.ndimage import uniform_filter1d

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
        axes.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
        axes.yaxis.set_major_formatter("{x:g}")
        axes.yaxis.set_minor_formatter(NullFormatter())
        for name, history in histories.items():
            _draw_history(axes, styles[name], history)
        axes.set(xlabel="iteration", ylabel="loss", title="Learning")
        axes.xaxis.set_major_locator(MaxNLocator(6, integer=True))
        axes.margins(x=0.02)
        canvas.add_grid(axes)
        _explain_lines(axes, histories)
        figure.draw_without_rendering()
        ends = {name: _end(history) for name, history in histories.items()}
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


def _end(history: History) -> tuple[float, float] | None:
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
