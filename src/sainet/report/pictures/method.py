"""The method as a picture: the engine predicts the push, the network corrects it."""

from pathlib import Path
from typing import NamedTuple

from matplotlib.axes import Axes

from sainet.report.figures.canvas import house_look, save
from sainet.report.palette import INK, style_of
from sainet.report.pictures.drawing import Point, arrow, bare_axes, box, note

_SIZE = (2.5, 1.25)


class _Part(NamedTuple):
    """A box with its title and its lines of text."""

    corner: Point
    color: str
    title: str
    lines: tuple[str, ...]

    def side(self, across: float, up: float) -> Point:
        """Return a point of the box; (0, 0) is its lower left corner."""
        return self.corner[0] + across * _SIZE[0], self.corner[1] + up * _SIZE[1]


def draw_method(path: Path) -> Path:
    """Draw what SAIN computes for one push, and how it is trained."""
    physics, sain = style_of("physics").color, style_of("sain").color
    start = _Part(
        (0, 0), INK, "Start and push", ("poses of the disks", "path of the pusher")
    )
    engine = _Part(
        (3.6, 1.3),
        physics,
        "Internal engine",
        ("assumed masses,", "radii and friction"),
    )
    network = _Part(
        (7.2, 0), sain, "Network", ("true masses, radii;", "one step at a time")
    )
    result = _Part((10.8, 0), sain, "Model prediction ŝ", ("poses at every step",))
    truth = _Part((10.8, 2.6), INK, "Ground truth s", ("simulated, or", "recorded"))
    with house_look():
        figure, axes = bare_axes(8.6, 2.75, (-0.15, 13.45), (-0.75, 3.95))
        for part in (start, engine, network, result, truth):
            _draw(axes, part)
        arrow(axes, start.side(1, 0.75), engine.side(0, 0.4), physics)
        arrow(axes, start.side(1, 0.3), network.side(0, 0.3))
        arrow(axes, engine.side(1, 0.4), network.side(0, 0.75), physics)
        note(axes, (6.95, 2.2), "simulator", color=physics, size=8)
        note(axes, (6.95, 1.9), "prediction s̄", color=physics, size=8)
        arrow(axes, network.side(1, 0.5), result.side(0, 0.5), sain)
        arrow(axes, truth.side(0.5, 0), result.side(0.5, 1), dashed=True)
        note(axes, (11.9, 1.92), "training makes", size=8, align="right")
        note(axes, (11.9, 1.62), "the difference small", size=8, align="right")
        _feedback(axes, network, sain)
        return save(figure, path)


def _draw(axes: Axes, part: _Part) -> None:
    box(axes, part.corner, _SIZE, part.color)
    note(axes, part.side(0.5, 0.78), part.title, bold=True, color=part.color, size=9)
    for index, text in enumerate(part.lines):
        note(axes, part.side(0.5, 0.47 - 0.25 * index), text, size=8)


def _feedback(axes: Axes, network: _Part, color: str) -> None:
    """Draw the loop in which the network's step is the input of the next step."""
    right, left = network.side(0.8, 0), network.side(0.2, 0)
    below = right[1] - 0.28
    axes.plot(
        [right[0], right[0], left[0]], [right[1], below, below], color=color, lw=1.4
    )
    arrow(axes, (left[0], below), left, color)
    note(
        axes, (network.side(0.5, 0)[0], below - 0.24), "next step", color=color, size=8
    )
