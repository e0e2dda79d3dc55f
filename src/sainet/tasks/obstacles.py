"""Disks that lie beside the way of the target disk to its goal, and are not wanted."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from sainet.runs.errors import BadInput

_STREAM = 0x0B57
_CLEAR_MM = (2.0, 30.0)  # between an obstacle and the way of the target disk
_ARRANGEMENTS = 50  # of all obstacles
_TRIES = 200  # for each obstacle of an arrangement


class Way(NamedTuple):
    """The straight way of the target disk to its goal."""

    target: int  # index of that disk
    goal: Float[np.ndarray, " 2"]  # m


def draw_obstacles(
    seed: int,
    trial: int,
    way: Way,
    placed: Float[np.ndarray, "disk 2"],
    radius: Float[np.ndarray, " body"],
) -> Float[np.ndarray, "obstacle 2"]:
    """Return the centres of obstacles (m); equal seeds and trials have equal ones.

    Each lies beside the way, at most 30 mm from the disk that moves along it, and at
    least 2 mm from that disk and from every other.

    Args:
        seed: common to all trials.
        trial: index of the trial.
        way: of the target disk.
        placed: centres of the disks in the row, m.
        radius: of those disks, then of the obstacles, m.

    Raises:
        BadInput: there is no room for so many.
    """
    rng = np.random.default_rng([_STREAM, seed, trial])
    radius = np.asarray(radius, np.float64)
    found, failed = list(np.asarray(placed, np.float64)), 0
    while len(found) < len(radius):
        own = float(radius[len(found)])
        reach = float(radius[way.target]) + own
        for _ in range(_TRIES):
            place = _beside(rng, found[way.target], way.goal, reach)
            apart = np.hypot(*(np.array(found) - place).T) - radius[: len(found)] - own
            if apart.min() >= _CLEAR_MM[0] / 1000:
                found.append(place)
                break
        else:  # those before it are in its way: draw all again
            if (failed := failed + 1) == _ARRANGEMENTS:
                raise BadInput(
                    f"`obstacles` is {len(radius) - len(placed)}: they have no room "
                    "beside the way to the goal; give fewer."
                )
            del found[len(placed) :]
    return np.array(found[len(placed) :])


def _beside(
    rng: np.random.Generator,
    start: Float[np.ndarray, " 2"],
    goal: Float[np.ndarray, " 2"],
    radii: float,
) -> Float[np.ndarray, " 2"]:
    """Return a random place beside the way, for a disk of that sum of both radii."""
    along = goal - start
    across = np.array([-along[1], along[0]]) / np.hypot(*along) * rng.choice([-1, 1])
    clear = radii + rng.uniform(*_CLEAR_MM) / 1000
    return start + rng.uniform() * along + clear * across
