"""Pictures of disks on a table, drawn with NumPy."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, UInt8

from sainet.scenes.scene import Scene
from sainet.scenes.state import State

# The colours of all episodes (`report/palette.py`).
INK, PAPER = "#2f3437", "#ffffff"
PUSHED, MOVED, OTHER, TARGET = "#c8553d", "#2a6fb5", "#8b8f94", "#f0c808"
SIDE = 480  # pixels
_MARGIN = 0.12  # m around centres and goal
_LINE = 0.002  # m, half the width of a line
_TICK = 0.6  # length of the mark of an angle, in radii

Picture = UInt8[np.ndarray, "row column 3"]


@dataclass(frozen=True)
class View:
    """The square of the table that a picture shows."""

    centre: Float[np.ndarray, "2"]  # m
    side: float  # m

    @classmethod
    def around(cls, points: Float[np.ndarray, "point 2"]) -> "View":
        """Return a view with room around all points (m)."""
        low, high = points.min(axis=0), points.max(axis=0)
        return cls((low + high) / 2, float((high - low).max()) + 2 * _MARGIN)


class Canvas:
    """A picture under construction; shapes cover what was drawn before."""

    def __init__(self, view: View, side: int = SIDE) -> None:
        """Begin with an empty table."""
        self._pixel = view.side / side  # m
        steps = (np.arange(side) + 0.5) * self._pixel - view.side / 2
        self._x = view.centre[0] + steps[None, :]
        self._y = view.centre[1] - steps[:, None]
        self._picture = np.full((side, side, 3), _rgb(PAPER))

    def disk(self, place: np.ndarray, radius: float, color: str) -> None:
        """Fill a disk (m)."""
        self._cover(np.hypot(self._x - place[0], self._y - place[1]) - radius, color)

    def ring(self, place: np.ndarray, radius: float, color: str) -> None:
        """Draw a circle (m)."""
        away = np.hypot(self._x - place[0], self._y - place[1])
        self._cover(np.abs(away - radius) - _LINE, color)

    def line(self, start: np.ndarray, end: np.ndarray, color: str) -> None:
        """Draw a line between two different points (m)."""
        way = end - start
        x, y = self._x - start[0], self._y - start[1]
        along = np.clip((x * way[0] + y * way[1]) / (way @ way), 0, 1)
        away = np.hypot(x - along * way[0], y - along * way[1])
        self._cover(away - _LINE, color)

    @property
    def picture(self) -> Picture:
        """The picture, its first row on top."""
        return np.round(self._picture).astype(np.uint8)

    def _cover(self, outside: np.ndarray, color: str) -> None:
        """Colour the pixels at negative distances (m), smoothly over one pixel."""
        share = np.nan_to_num(np.clip(0.5 - outside / self._pixel, 0, 1))[..., None]
        self._picture += share * (_rgb(color) - self._picture)


class Goal(NamedTuple):
    """Where a disk is wanted."""

    place: Float[np.ndarray, "2"]  # m
    target: int  # index of that disk
    tolerance: float  # distance that counts as reached, m


@np.errstate(invalid="ignore")
def draw(view: View, scene: Scene, state: State, goal: Goal) -> Picture:
    """Return a picture of the disks, the pusher and the goal, without unknown poses.

    Args:
        view: what the picture shows.
        scene: has the radii.
        state: poses to draw.
        goal: of the target disk.
    """
    canvas, radius = Canvas(view), np.asarray(scene.radius, np.float64)
    place, angle = np.asarray(state.position), np.asarray(state.angle)
    canvas.ring(goal.place, radius[goal.target], TARGET)
    for disk, size in enumerate(radius):
        color = {0: PUSHED, goal.target: MOVED}.get(disk, OTHER)
        canvas.disk(place[disk], size, color)
        turned = np.array([np.cos(angle[disk]), np.sin(angle[disk])])
        canvas.line(place[disk], place[disk] + _TICK * size * turned, PAPER)
    canvas.disk(goal.place, goal.tolerance, TARGET)
    canvas.disk(np.asarray(state.pusher_position), float(scene.pusher_radius), INK)
    return canvas.picture


def _rgb(color: str) -> Float[np.ndarray, "3"]:
    return np.array([int(color[i : i + 2], 16) for i in (1, 3, 5)], np.float64)
