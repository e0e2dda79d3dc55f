"""Figures of one push: predicted paths, and errors over time.

Each function uses only Matplotlib objects (no window, no global state except the
style during the call), writes SVG or PNG by suffix, atomically, and returns the
path. Paths have a panel of the whole scene, and a magnified panel for each disk.
"""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Patch
from matplotlib.ticker import MaxNLocator
from matplotlib.transforms import ScaledTranslation

from sainet.models.identity import ModelId
from sainet.report.episode_frames import Replay, Track
from sainet.report.figures import canvas
from sainet.report.palette import INK, ModelStyle, styles_of

Curve = Float[np.ndarray, "time body"]  # mm
Models = Iterable[ModelId]
_MM = 1e3  # mm in a metre
_SMALLEST_LENS = 1.0  # mm, the least width that a lens shows
# Where the panels go (inches): squares whose tops are in line, legends under them.
_SCENE_WIDTH, _LENS_WIDTH, _GAP = 3.4, 2.2, 0.62
_TOP, _BOTTOM, _LINE = 0.42, 0.68, 0.185
_LEGEND_DROP = 0.56  # below the axis label


def draw_paths(replay: Replay, path: Path) -> Path:
    """Draw the predicted and true paths of one push.

    The first panel shows the whole scene. One panel per disk shows the path of its
    centre on a millimetre scale, with the final errors of each model.
    """
    styles = styles_of(replay.tracks, replay.models)
    with canvas.house_look():
        figure, panels = _push_panels(replay.body_count, len(styles))
        _draw_scene(panels[0], replay, styles)
        for body, axes in enumerate(panels[1:]):
            _draw_lens(axes, replay, body, styles)
        canvas.name_panels(figure)
        return canvas.save(figure, path)


def draw_error_over_time(
    curves: Mapping[str, Curve], path: Path, *, time_step: float, models: Models = ()
) -> Path:
    """Draw the mean position error over the time of a push, one panel per disk.

    Args:
        curves: by model, the error after each step (mm).
        path: where to write; ``.svg`` or ``.png``.
        time_step: seconds between two steps; the first row is one step in.
        models: give the labels.
    """
    styles = styles_of(curves, models)
    bodies = next(iter(curves.values())).shape[1]
    with canvas.house_look():
        figure = canvas.new_figure(1.2 + 3.6 * bodies, 3.2)
        panels = figure.subplots(1, bodies, squeeze=False, sharey=True)[0]
        for body, axes in enumerate(panels):
            for name, curve in curves.items():
                time = time_step * np.arange(1, len(curve) + 1)
                axes.plot(time, curve[:, body], **canvas.line_look(styles[name]))
            words = {"xlabel": "time (s)", "ylabel": "mean position error (mm)"}
            axes.set(**words, title=f"Disk {body + 1}")
            axes.set_xlim(0, axes.dataLim.x1)
            axes.tick_params(labelleft=True)  # a page may stack the panels
            canvas.add_grid(axes)
        panels[0].set_ylim(bottom=0)
        figure.draw_without_rendering()
        for body, axes in enumerate(panels):
            ends = [(time_step * len(each), each[-1, body]) for each in curves.values()]
            canvas.label_ends(axes, list(styles.values()), ends)
        canvas.name_panels(figure)
        return canvas.save(figure, path)


def _push_panels(lenses: int, models: int) -> tuple[Figure, list[Axes]]:
    """Return a figure and its panels: the scene, then one magnified panel per disk."""
    first, slot = 2 * _GAP + _SCENE_WIDTH, _LENS_WIDTH + _GAP
    starts = [first + slot * lens for lens in range(lenses)]
    width = starts[-1] + _LENS_WIDTH + 0.45
    height = _TOP + _LENS_WIDTH + _BOTTOM + models * _LINE
    figure = Figure(figsize=(width, height))
    bottom, tall = height - _TOP - _LENS_WIDTH, _LENS_WIDTH / height
    boxes = [(_GAP, _SCENE_WIDTH), *((start, _LENS_WIDTH) for start in starts)]
    panels = [
        figure.add_axes((left / width, bottom / height, wide / width, tall))
        for left, wide in boxes
    ]
    return figure, panels


def _draw_scene(axes: Axes, replay: Replay, styles: dict[str, ModelStyle]) -> None:
    """Draw the disks at the start (dashed) and at the end, with the pusher (mm)."""
    reference = replay.reference
    _draw_truth(axes, replay)
    for name, track in list(replay.tracks.items())[1:]:
        style = styles[name]
        for body, radius in enumerate(replay.radius):
            _circle(axes, track.position[-1, body], radius, edgecolor=style.color)
            axes.plot(
                *(_MM * track.position[:, body].T), **canvas.line_look(style, 1.0)
            )
    for body in range(replay.body_count):
        axes.plot(*(_MM * reference.position[:, body].T), color=INK, linewidth=1.2)
    axes.autoscale_view()
    axes.set_aspect("equal", anchor="NW")
    axes.set(xlabel="x (mm)", ylabel="y (mm)", title="The push")
    start = Line2D([], [], label="start", color=INK, alpha=0.5, dashes=(3, 3))
    end = Patch(facecolor=(INK, 0.10), edgecolor=INK, label="true end")
    guess = Patch(facecolor="none", edgecolor=INK, label="predicted end (coloured)")
    _explain_below(axes, [start, end, guess])


def _draw_lens(
    axes: Axes, replay: Replay, body: int, styles: dict[str, ModelStyle]
) -> None:
    """Draw the paths of one disk's centre (mm from its true initial position)."""
    origin = replay.reference.position[0, body]
    paths = {
        name: _MM * (track.position[:, body] - origin)
        for name, track in replay.tracks.items()
    }
    # Draw the ground truth last, on top of the predictions.
    for name in [*list(paths)[1:], *list(paths)[:1]]:
        path = paths[name]
        axes.plot(*path.T, **canvas.line_look(styles[name]))
        axes.plot(*path[-1], "o", color=styles[name].color, markersize=5)
    axes.plot(0, 0, "o", markersize=4, markerfacecolor="none", markeredgecolor=INK)
    _frame(axes, np.concatenate(list(paths.values())))
    canvas.add_grid(axes, "both")
    axes.set(xlabel="x (mm)", ylabel="y (mm)", title=f"Centre of disk {body + 1}")
    handles = [_handle(replay, name, body, style) for name, style in styles.items()]
    _explain_below(axes, handles)


def _draw_truth(axes: Axes, replay: Replay) -> None:
    truth = replay.reference
    for body, radius in enumerate(replay.radius):
        start, end = truth.position[0, body], truth.position[-1, body]
        _circle(axes, start, radius, edgecolor=INK, linestyle=(0, (3, 3)), alpha=0.5)
        _circle(axes, end, radius, facecolor=(INK, 0.10), edgecolor=INK)
        _draw_mark(axes, truth, body, radius)
    for place, filled in ((truth.pusher[0], False), (truth.pusher[-1], True)):
        face = INK if filled else "none"
        _circle(
            axes, place, replay.pusher_radius, facecolor=face, edgecolor=INK, alpha=0.7
        )


def _draw_mark(axes: Axes, track: Track, body: int, radius: float) -> None:
    """Write the number of the disk, and draw its angle as a mark on the rim."""
    place, angle = _MM * track.position[-1, body], track.angle[-1, body]
    ray = _MM * radius * np.array([np.cos(angle), np.sin(angle)])
    axes.plot(*np.stack([place + 0.78 * ray, place + ray]).T, color=INK, linewidth=1.2)
    axes.annotate(
        f"disk {body + 1}",
        place - (0, 0.55 * _MM * radius),
        ha="center",
        va="center",
        fontsize=8.5,
    )


def _circle(
    axes: Axes,
    place: Float[np.ndarray, "2"],
    radius: float,
    **look: Any,  # noqa: ANN401
) -> None:
    defaults = {"facecolor": "none", "linewidth": 1.0}
    if np.isfinite(place).all():
        x, y = _MM * place
        axes.add_patch(Circle((x, y), _MM * radius, **(defaults | look)))


def _frame(axes: Axes, points: Float[np.ndarray, "n 2"]) -> None:
    """Set square limits with a margin around all points, with equal scales."""
    low, high = np.nanmin(points, axis=0), np.nanmax(points, axis=0)
    half = 0.5 * 1.16 * max(float((high - low).max()), _SMALLEST_LENS)
    middle = (low + high) / 2
    axes.set_xlim(middle[0] - half, middle[0] + half)
    axes.set_ylim(middle[1] - half, middle[1] + half)
    axes.set_aspect("equal")
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(MaxNLocator(5, steps=[1, 2, 5, 10]))


def _explain_below(axes: Axes, handles: Sequence[Artist]) -> None:
    inches = axes.figure.dpi_scale_trans
    axes.legend(
        handles=handles,
        loc="upper left",
        bbox_to_anchor=(0, 0),
        bbox_transform=axes.transAxes + ScaledTranslation(0, -_LEGEND_DROP, inches),
        borderaxespad=0,
        borderpad=0,
        handlelength=1.8,
        labelspacing=0.35,
    )


def _handle(replay: Replay, name: str, body: int, style: ModelStyle) -> Line2D:
    label = style.label
    if replay.tracks[name] is not replay.reference:
        error = replay.errors_mm(name)[-1, body]
        turn = replay.final_turn_deg(name)[body]
        if np.isfinite(error + turn):
            label = f"{label}: {error:.2f} mm, {turn:.1f}°"
    return Line2D([], [], label=label, **canvas.line_look(style))
