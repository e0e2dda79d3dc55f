"""Figures of one push: predicted paths, and errors over time.

Each function uses only Matplotlib objects (no window, no global state except the
style during the call), writes SVG or PNG by suffix, atomically, and returns the
path.
"""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from jaxtyping import Float

from sainet.report.figures.canvas import (
    add_grid,
    house_look,
    label_ends,
    line_look,
    new_figure,
    save,
)
from sainet.report.figures.panels import draw_lens, draw_scene, push_panels
from sainet.report.palette import ModelStyle, styles_of
from sainet.report.replay import Replay

Curve = Float[np.ndarray, "time body"]  # mm


def draw_paths(replay: Replay, path: Path) -> Path:
    """Draw the predicted and true paths of one push.

    The first panel shows the whole scene. One panel per disk shows the path of its
    centre on a millimetre scale, with the final errors of each model.
    """
    styles = styles_of(replay.tracks)
    with house_look():
        figure, panels = push_panels(replay.body_count, len(styles))
        draw_scene(panels[0], replay, styles)
        for body, axes in enumerate(panels[1:]):
            draw_lens(axes, replay, body, styles)
        return save(figure, path)


def draw_error_over_time(
    curves: Mapping[str, Curve],
    path: Path,
    *,
    time_step: float,
    bands: Mapping[str, tuple[Curve, Curve]] | None = None,
) -> Path:
    """Draw the mean position error over the time of a push, one panel per disk.

    Args:
        curves: by model, the error after each step (mm).
        path: where to write; ``.svg`` or ``.png``.
        time_step: seconds between two steps; the first row is one step in.
        bands: by model, the low and high ends of an interval (mm), if there is one.
    """
    styles = styles_of(curves)
    bodies = next(iter(curves.values())).shape[1]
    with house_look():
        figure = new_figure(1.2 + 3.6 * bodies, 3.2)
        panels = figure.subplots(1, bodies, squeeze=False, sharey=True)[0]
        for body, axes in enumerate(panels):
            for name, curve in curves.items():
                time = time_step * np.arange(1, len(curve) + 1)
                axes.plot(time, curve[:, body], **line_look(styles[name]))
                if bands and name in bands:
                    low, high = (side[:, body] for side in bands[name])
                    look = {"color": styles[name].color, "linewidth": 0}
                    axes.fill_between(time, low, high, alpha=0.16, **look)
            axes.set(xlabel="time (s)", title=f"Disk {body + 1}")
        panels[0].set_ylabel("mean position error (mm)")
        panels[0].set_ylim(bottom=0)
        for axes in panels:
            axes.set_xlim(0, axes.dataLim.x1)
            axes.margins(x=0)
            add_grid(axes)
        figure.draw_without_rendering()
        _label_panels(panels, curves, styles, time_step)
        return save(figure, path)


def _label_panels(
    panels: np.ndarray,
    curves: Mapping[str, Curve],
    styles: dict[str, ModelStyle],
    time_step: float,
) -> None:
    for body, axes in enumerate(panels):
        ends = [(time_step * len(curve), curve[-1, body]) for curve in curves.values()]
        label_ends(axes, list(styles.values()), ends)
