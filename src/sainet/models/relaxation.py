"""How a residual network's deviation from the engine goes on.

Each step leaves a share of the rate by which it deviates, and adds what the network
says: d' = a d + dt f, e' = e + dt d', where e and d are the deviations of pose and rate
and a = exp(-dt / tau). Friction stops what is pushed as fast as that; without it
whatever f says adds up for seconds.
"""

import math
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

RELAXATION_TIME = 0.1  # tau, s


def relaxation(time_step: float) -> float:
    """Return the share of the deviating rate that a step (s) leaves."""
    return math.exp(-time_step / RELAXATION_TIME)


class Gains(NamedTuple):
    """What a deviation becomes after each of some steps, while f stays the same."""

    rate_of_rate: Float[np.ndarray, " step"]
    rate_of_change: Float[np.ndarray, " step"]  # s
    pose_of_rate: Float[np.ndarray, " step"]  # s
    pose_of_change: Float[np.ndarray, " step"]  # s^2


def gains(time_step: float, steps: int) -> Gains:
    """Return the gains of the deviating rate and of f (the change of it)."""
    left = relaxation(time_step) ** np.arange(1, steps + 1)
    added = time_step * np.cumsum(np.append(1.0, left[:-1]))
    return Gains(left, added, time_step * np.cumsum(left), time_step * np.cumsum(added))
