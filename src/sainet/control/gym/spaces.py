"""Observations, goals and rewards: their spaces, and rewards of any goals."""

from typing import Any

import numpy as np
from jaxtyping import Bool, Float

from sainet.control.gym.config import PushDisksConfig
from sainet.control.gym.extra import gymnasium
from sainet.control.gym.task import PushDisksTask
from sainet.runs.errors import BadInput, BadSetting, shown

TABLE = 2.0  # m, half the side of the table, whose centre is the origin
_MOST_TURNED = 1000.0  # rad; angles are never wrapped
_LARGEST = np.array([TABLE, TABLE, _MOST_TURNED], np.float32)  # of a pose


def observation_space(task: PushDisksTask) -> gymnasium.Space[Any]:
    """Return the space of the observations of one environment.

    Raises:
        BadSetting: the disks do not fit on the table.
    """
    row = float(2 * np.asarray(task.scene.radius).sum())
    if row > TABLE:
        wanted = f"so few that the row of {row:.1f} m is at most {TABLE:g} m long"
        raise BadSetting("disks", task.scene.body_count, wanted)
    high = np.tile(_LARGEST, task.scene.body_count)
    box = gymnasium.spaces.Box
    spaces: dict[str, gymnasium.Space[Any]] = {
        "observation": box(-high, high, dtype=np.float32),
        "achieved_goal": box(-TABLE, TABLE, (2,), np.float32),
        "desired_goal": box(-TABLE, TABLE, (2,), np.float32),
    }
    return gymnasium.spaces.Dict(spaces)


def goal_on_table(goal: object) -> Float[np.ndarray, "2"]:
    """Return a goal as an array.

    Raises:
        BadInput: it is no position on the table.
    """
    try:
        place = np.asarray(goal, np.float32)
    except (TypeError, ValueError):
        place = np.empty(0, np.float32)
    if place.shape != (2,) or not (np.abs(place) <= TABLE).all():  # also NaN
        raise BadInput(
            f"options: 'goal' is {shown(goal)}, which is not on the table; give x and "
            f"y from -{TABLE:g} to {TABLE:g} m."
        )
    return place


def distances(
    achieved: Float[np.ndarray, "*env 2"], desired: Float[np.ndarray, "*env 2"]
) -> Float[np.ndarray, "*env"]:
    """Return the distances of positions from their goals (m)."""
    away = np.asarray(achieved, np.float32) - np.asarray(desired, np.float32)
    return np.asarray(np.sqrt(np.sum(away * away, axis=-1)))


class GoalRewards:
    """Rewards of an environment, for any goals."""

    config: PushDisksConfig
    task: PushDisksTask

    def compute_reward(
        self,
        achieved_goal: Float[np.ndarray, "*env 2"],
        desired_goal: Float[np.ndarray, "*env 2"],
        info: object,
    ) -> Float[np.ndarray, "*env"]:
        """Return the rewards of positions of the target disk, for any goals.

        Args:
            achieved_goal: measured positions of the target disk (m).
            desired_goal: goals (m).
            info: has no effect.
        """
        return self.rewards(distances(achieved_goal, desired_goal))

    def rewards(self, distance: Float[np.ndarray, "*env"]) -> Float[np.ndarray, "*env"]:
        """Return the rewards at measured distances from the goal (m)."""
        if self.config.reward == "dense":
            return np.asarray(-distance)
        is_there = distance <= np.float32(self.task.tolerance)
        return np.where(is_there, 0.0, -1.0).astype(np.float32)


def is_on_table(pose: Float[np.ndarray, "*env disk 3"]) -> Bool[np.ndarray, "*env"]:
    """Return whether all poses are finite, with the centres on the table."""
    return np.asarray((np.abs(pose) <= _LARGEST).all(axis=(-2, -1)))
