"""Random goals as in the paper (section IV-A): easy goals ahead, hard goals aside."""

from typing import Literal

import numpy as np

GoalKind = Literal["easy", "hard"]
# Angles from the axis through the disks, to either side (degrees).
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
    """Return the position of a goal (m); equal seeds and trials have equal goals.

    Args:
        kind: easy or hard.
        seed: common to all trials.
        trial: index of the trial.
        disk: centre of the target disk, m.
        axis: angle of the axis through the disks, rad.
        radius: radius of the target disk, m.
    """
    rng = np.random.default_rng([_STREAM, seed, trial, list(ANGLES).index(kind)])
    low, high = np.deg2rad(ANGLES[kind])
    angle = axis + rng.uniform(low, high) * rng.choice([-1, 1])
    way = np.array([np.cos(angle), np.sin(angle)])
    return np.asarray(disk) + DISTANCE_RADII * radius * way
