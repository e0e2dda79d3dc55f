"""One push: ground truth, physics, IN and SAIN, as a picture."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes

from sainet.engines.planar.engine import PlanarEngine
from sainet.models.dynamics import AbstractDynamics, PhysicsDynamics
from sainet.models.library import load_model
from sainet.models.push_inputs import predict_push
from sainet.report.figures.canvas import (
    add_grid,
    house_look,
    line_look,
    new_figure,
    save,
)
from sainet.report.palette import INK, MOVED, PUSHED, style_of
from sainet.report.pictures.drawing import arrow, disk, note, prepare
from sainet.scenes.pushes import Push
from sainet.scenes.scene import Scene

_STEPS = 80  # 48 of motion, 32 at rest
_DRAWN = ("truth", "physics", "in", "sain")
_RADIUS_MM = (57.0, 51.0)
# Half the size of uniform pressure: with it the planar engine is nearest to Bullet,
# whose pushes the networks were trained on.
_PRESSURE = 0.5

_WHY = "assumed radii overlap\nat the start: the engine\nfirst moves disk 1 back"

Paths = Mapping[str, Float[np.ndarray, "step body 2"]]


def draw_one_push(path: Path) -> Path:
    """Draw one simulated push, and the paths that each model predicts for it."""
    paths = _predictions()
    with house_look():
        figure = new_figure(8.6, 4.2)
        places = figure.subplot_mosaic("AB;AC", width_ratios=(1, 1.15))
        scene, *panels = (places[name] for name in "ABC")
        _draw_scene(scene, paths["truth"])
        for body, axes in enumerate(panels):
            _draw_paths(axes, {name: each[:, body] for name, each in paths.items()})
            axes.set_title(f"Path of the centre of disk {body + 1}")
        note(panels[0], (10.9, 0.5), _WHY, size=7.5, align="right")
        figure.legend(
            *panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=4
        )
        return save(figure, path)


def _predictions() -> Paths:
    """Return the path of each disk (mm), rounded so that machines agree."""
    scene = Scene.disks(mass=[1.1, 0.87], radius=[r / 1000 for r in _RADIUS_MM])
    start, push = scene.in_a_row(), Push(contact_angle=0.42, direction=-0.2)
    found: dict[str, Float[np.ndarray, "step body 2"]] = {}
    for name, dynamics in _models().items():
        states = predict_push(dynamics, scene, start, push, _STEPS).states
        path = np.concatenate([start.position[None], states.position])
        found[name] = np.round(1000 * np.asarray(path, float), 2)
    return found


def _models() -> dict[str, AbstractDynamics]:
    truth = PhysicsDynamics(PlanarEngine(pressure_radius_ratio=_PRESSURE))
    return {"truth": truth} | {n: load_model(n).dynamics for n in _DRAWN[1:]}


def _draw_scene(axes: Axes, truth: Float[np.ndarray, "step body 2"]) -> None:
    prepare(axes, (-72, 172), (-85, 75))
    axes.set_title("The push")
    for body, (radius, color) in enumerate(
        zip(_RADIUS_MM, (PUSHED, MOVED), strict=True)
    ):
        start, end = truth[0, body], truth[-1, body]
        disk(axes, (start[0], start[1]), radius, color)
        disk(axes, (end[0], end[1]), radius, color, ghost=True)
        note(axes, (start[0], start[1] + 20), f"disk {body + 1}", color=color)
    angle = np.pi + 0.42
    reach = _RADIUS_MM[0] + 4.8
    x, y = reach * np.cos(angle), reach * np.sin(angle)
    disk(axes, (x, y), 4.8, INK)
    heading = 0.42 - 0.2
    arrow(axes, (x, y), (x + 40 * np.cos(heading), y + 40 * np.sin(heading)))
    note(axes, (50, -75), "outlines: ground truth at the end", size=8)


def _draw_paths(axes: Axes, paths: Paths) -> None:
    add_grid(axes, "both")
    axes.set_xlabel("x (mm)")
    axes.set_ylabel("y (mm)")
    origin = paths["truth"][0]
    for name, path in paths.items():
        style = style_of(name)
        x, y = (path - origin).T
        axes.plot(x, y, label=style.label, **line_look(style))
        axes.plot(x[-1], y[-1], "o", color=style.color, markersize=4)
    axes.set_xlim(-2.2, 11.2)
    axes.set_ylim(-0.8, 5.6)
    axes.set_aspect("equal")
