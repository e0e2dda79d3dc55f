"""Goals drawn as in the paper (section IV-A): easy ones ahead, hard ones aside."""

from typing import Literal

import numpy as np

GoalKind = Literal["easy", "hard"]
# Angles from the axis of the disks, to either side (degrees).
ANGLES: dict[GoalKind, tuple[float, float]] = {
    "easy": (0.0, 30.0),
    "hard": (30.0, 60.0),
}
DISTANCE_RADII = 3.0
_STREAM = 0x60A1


def draw_goal(
    kind: GoalKind,
    seed: int,
    trial: int,
    *,
    disk: np.ndarray,
    axis: float,
    radius: float,
) -> np.ndarray:
    """Draw the place of a goal (m); the same seed and trial give the same goal.

    Args:
        kind: easy or hard.
        seed: of all trials.
        trial: which one.
        disk: centre of the disk that is to be moved, m.
        axis: angle that the goal's angle is measured from, rad.
        radius: of that disk, m.
    """
    rng = np.random.default_rng([_STREAM, seed, trial, list(ANGLES).index(kind)])
    low, high = np.deg2rad(ANGLES[kind])
    angle = axis + rng.uniform(low, high) * rng.choice([-1, 1])
    way = np.array([np.cos(angle), np.sin(angle)])
    return np.asarray(disk) + DISTANCE_RADII * radius * way
