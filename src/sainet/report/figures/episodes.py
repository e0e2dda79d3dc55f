"""Control episodes in the style of the paper's figure: start, goal and end."""

import math
import textwrap
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Circle

from sainet.control.record import EpisodeRecord
from sainet.report.episode_frames import outcome
from sainet.report.figures.canvas import house_look, new_figure, save
from sainet.report.palette import INK, MOVED, OTHER, PUSHED, TARGET, style_of

_ACROSS = 3  # panels
_TITLE_WIDTH = 26  # characters; a longer title would leave the figure
_MARGIN = 10  # mm around the drawing

Place = Sequence[float] | np.ndarray  # mm


def draw_episodes(
    records: Sequence[EpisodeRecord],
    path: Path,
    titled: Callable[[EpisodeRecord], str] = outcome,
) -> Path:
    """Draw one panel per episode: initial disks transparent, final disks solid.

    The target region is the tolerance around the goal; a white cross marks the final
    centre of the target disk.

    Args:
        records: records from the run folder of `sainet control`.
        path: where to write; ``.svg`` or ``.png``.
        titled: returns the title of a panel.
    """
    across = min(_ACROSS, len(records))
    down = math.ceil(len(records) / across)
    with house_look():
        figure = new_figure(0.4 + 2.9 * across, 0.3 + 2.6 * down)
        panels = figure.subplots(down, across, squeeze=False).ravel()
        # All panels share one scale, so that episodes can be compared.
        low, high = _extent(records)
        for axes, record in zip(panels, records, strict=False):
            draw_episode(axes, record, titled(record))
            axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
        for axes in panels[len(records) :]:
            axes.set_axis_off()
        return save(figure, path)


def draw_side_by_side(records: Sequence[EpisodeRecord], path: Path) -> Path:
    """Draw episodes of several models with one goal, under the names of the models."""
    return draw_episodes(
        records, path, lambda each: f"{style_of(each.model).label}:\n{outcome(each)}"
    )


def _extent(records: Sequence[EpisodeRecord]) -> tuple[np.ndarray, np.ndarray]:
    """Return the lower left and upper right corners of the drawing (mm)."""
    places = [body_paths(record)[..., :2].reshape(-1, 2) for record in records]
    goals = np.array([record.goal_mm for record in records])
    every = np.concatenate([*places, goals])
    reach = _MARGIN + max(max(record.radius_mm) for record in records)
    # Diverged poses have no position.
    return np.nanmin(every, axis=0) - reach, np.nanmax(every, axis=0) + reach


def draw_episode(axes: Axes, record: EpisodeRecord, title: str) -> None:
    """Draw one episode (mm) under a title and how far from the goal it ended."""
    path = body_paths(record)
    for body, radius in enumerate(record.radius_mm):
        color = body_color(record, body)
        centres = path[:, body, :2]
        _disk(axes, centres[0], radius, facecolor=(color, 0.15), edgecolor=(color, 0.5))
        _disk(axes, centres[-1], radius, facecolor=(color, 0.85), edgecolor=color)
        axes.plot(*centres.T, color=color, linewidth=1.0)
    _disk(axes, record.goal_mm, record.tolerance_mm, facecolor=TARGET, zorder=4)
    end = path[-1, record.moved, :2]
    axes.plot(*end, "x", color="white", markersize=6, markeredgewidth=1.6, zorder=5)
    lines = (textwrap.fill(line, _TITLE_WIDTH) for line in title.splitlines())
    title = "\n".join(lines)
    off = record.final_mm
    axes.set_title(title if off is None else f"{title}\n{off:.1f} mm off")
    axes.set_aspect("equal")
    axes.set(xlabel="x (mm)", ylabel="y (mm)")


def body_paths(record: EpisodeRecord) -> np.ndarray:
    """Return the poses of all disks over an episode, ``[time, body, 3]`` (mm, deg).

    Diverged poses are NaN.
    """
    steps = record.steps
    if not steps:
        return np.asarray([record.final], float)
    poses = [steps[0].observed, *(pose for step in steps for pose in step.actual)]
    return np.asarray(poses, float)


def body_color(record: EpisodeRecord, body: int) -> str:
    """Return the colour of a disk: pushed disk red, target disk blue."""
    if body == record.moved:
        return MOVED
    return PUSHED if body == 0 else OTHER


def _disk(axes: Axes, centre: Place, radius: float, **look: Any) -> None:  # noqa: ANN401
    look.setdefault("edgecolor", INK)
    if np.isfinite(centre).all():
        axes.add_patch(Circle((centre[0], centre[1]), radius, linewidth=0.8, **look))
