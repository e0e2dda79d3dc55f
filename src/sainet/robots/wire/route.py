"""Routes of the pusher: down beside disk 1, straight, hold, and up again."""

from dataclasses import dataclass
from itertools import pairwise
from math import ceil

import numpy as np
from jaxtyping import Float

from sainet.robots.wire.cell import Cell
from sainet.robots.wire.limits import CYCLE, Stopped
from sainet.scenes.pushes import Push, place_pusher, push_direction
from sainet.scenes.scene import Scene
from sainet.scenes.state import State

_PEAK = 1.875  # largest speed of a leg from rest to rest, relative to its mean
_SETTLE = 0.1  # s, before the pusher moves straight

Path = Float[np.ndarray, "_ 3"]  # m, one row for each cycle
Place = Float[np.ndarray, "3"]  # m


@dataclass(frozen=True)
class Route:
    """The motions of one push, in the frame of the robot's base."""

    approach: Path  # up, across and down beside disk 1
    straight: Path  # at constant speed, then at rest
    retreat: Path  # up
    heading: Float[np.ndarray, "2"]  # unit vector on the table
    contact: Float[np.ndarray, "2"]  # m, on the table, where the pusher meets disk 1

    @property
    def whole(self) -> Path:
        """All motions one after another."""
        return np.concatenate([self.approach, self.straight, self.retreat])


def plan_route(cell: Cell, scene: Scene, tip: Place, state: State, push: Push) -> Route:
    """Return the route of a push.

    The straight motion begins `clearance_mm` before the contact, on its line.

    Args:
        cell: heights and speeds.
        scene: of the disks.
        tip: where the pusher is (m, in the frame of the robot's base).
        state: measured poses.
        push: to execute.

    Raises:
        Stopped: the pusher would descend on a disk.
    """
    to_robot, motion = cell.calibration.table_to_robot, cell.motion
    low, up = cell.pusher.push_height_mm / 1000, cell.pusher.travel_height_mm / 1000
    speed = motion.travel_speed_mm_s / 1000
    heading = np.asarray(push_direction(state, push), float)
    contact = np.asarray(place_pusher(scene, state, push), float)
    start = contact - cell.pusher.clearance_mm / 1000 * heading
    end = contact + float(push.length) * heading
    _check_descent(cell, state, start)
    now = to_robot.inverse.moved(tip)
    high = max(up, float(now[2]))
    corners = np.array([now, [*now[:2], high], [*start, high], [*start, low]])
    legs = [_leg(a, b, speed) for a, b in pairwise(corners)]
    straight = _line(np.array([*start, low]), np.array([*end, low]), float(push.speed))
    return Route(
        approach=to_robot.moved(_held(np.concatenate(legs), _SETTLE)),
        straight=to_robot.moved(_held(straight, motion.hold_s)),
        retreat=to_robot.moved(_leg(straight[-1], np.array([*end, up]), speed)),
        heading=heading,
        contact=contact,
    )


def _check_descent(cell: Cell, state: State, start: Float[np.ndarray, "2"]) -> None:
    """Refuse a place where the pusher would come down on a disk, or nearly."""
    centres = np.asarray(state.position, float)
    for disk, centre in zip(cell.disks, centres, strict=True):
        reach = (disk.radius_mm + cell.pusher.radius_mm) / 1000
        gap = 1000 * (float(np.linalg.norm(start - centre)) - reach)
        if gap < cell.pusher.clearance_mm / 2:
            raise Stopped(
                f"refused: the pusher would descend {gap:.1f} mm from '{disk.body}'; "
                f"at least {cell.pusher.clearance_mm / 2:g} mm are needed"
            )


def _leg(start: Place, end: Place, speed: float) -> Path:
    """Return a straight motion from rest to rest (minimum jerk) at most this fast."""
    distance = float(np.linalg.norm(end - start))
    rows = ceil(_PEAK * distance / (speed * CYCLE))
    u = np.arange(1, rows + 1) / max(rows, 1)
    share = u**3 * (10 - 15 * u + 6 * u**2)
    return start + share[:, None] * (end - start)


def _line(start: Place, end: Place, speed: float) -> Path:
    """Return a straight motion at constant speed (m/s)."""
    distance = float(np.linalg.norm(end - start))
    travelled = speed * CYCLE * np.arange(1, ceil(distance / (speed * CYCLE)) + 1)
    return start + np.minimum(travelled / distance, 1)[:, None] * (end - start)


def _held(path: Path, seconds: float) -> Path:
    """Return a path whose end is held."""
    return np.concatenate([path, np.tile(path[-1], (round(seconds / CYCLE), 1))])
