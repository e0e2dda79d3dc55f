"""The task of an environment: what every episode has in common."""

from dataclasses import dataclass
from typing import TypedDict

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from sainet.control.config import ControlConfig
from sainet.control.gym.actions import AbstractActions
from sainet.runs.errors import BadInput
from sainet.scenes.scene import Scene
from sainet.scenes.state import State, at_rest
from sainet.tasks.push_to_goal import PushToGoal


class Observation(TypedDict):
    """Measured poses and the goal, in the table frame; single precision."""

    # x (m), y (m) and angle (rad) of each disk, one disk after another
    observation: Float[np.ndarray, "*env pose"]
    achieved_goal: Float[np.ndarray, "*env 2"]  # of the target disk, m
    desired_goal: Float[np.ndarray, "*env 2"]  # m


@dataclass(frozen=True)
class PushDisksTask:
    """The disks, the actions and the tolerance of all episodes of an environment.

    The goal differs between episodes and is part of every observation.
    """

    scene: Scene  # properties given to models: never true frictions
    actions: AbstractActions
    config: ControlConfig

    @property
    def target(self) -> int:
        """The index of the target disk."""
        return self.config.target

    @property
    def tolerance(self) -> float:
        """The measured distance from the goal that ends an episode (m)."""
        within = self.config.tolerance * float(self.scene.radius[self.target])
        return self.config.stopping_tolerance * within

    def towards(self, goal: Float[np.ndarray, "2"]) -> PushToGoal:
        """Return the task of an episode, which ends at the stopping tolerance.

        Args:
            goal: wanted position of the target disk, m.
        """
        return PushToGoal(
            jnp.asarray(goal, jnp.float32),
            self.target,
            self.config.stopping_tolerance * self.config.tolerance,
            self.config.alignment,
        )

    def goal(self, observation: Observation) -> Float[np.ndarray, "2"]:
        """Return the goal of an observation (m).

        Raises:
            BadInput: the observation is not one of the environment.
        """
        return _part(observation, "desired_goal", (2,))

    def state(self, observation: Observation) -> State:
        """Return the observed poses as a state at rest; the pusher is not placed.

        Raises:
            BadInput: the observation is not one of the environment.
        """
        wanted = (3 * self.scene.body_count,)
        pose = jnp.asarray(_part(observation, "observation", wanted).reshape(-1, 3))
        return at_rest(pose[:, :2], pose[:, 2], jnp.zeros(2, jnp.float32))


def _part(
    observation: Observation, name: str, wanted: tuple[int, ...]
) -> Float[np.ndarray, " number"]:
    try:
        found = np.asarray(observation[name], np.float32)
    except (KeyError, TypeError, ValueError, IndexError):
        found = np.empty(0, np.float32)
    if found.shape != wanted:
        raise BadInput(
            f"observation: it has no numbers of shape {wanted} under '{name}'; give "
            "what `reset` or `step` returned."
        )
    return found


def observation_of(
    pose: Float[np.ndarray, "*env disk 3"],
    goal: Float[np.ndarray, "*env 2"],
    target: int,
) -> Observation:
    """Return an observation of measured poses; its arrays are new.

    Args:
        pose: of each disk, m and rad.
        goal: of the target disk, m.
        target: the index of that disk.
    """
    return Observation(
        observation=np.array(pose, np.float32).reshape(*pose.shape[:-2], -1),
        achieved_goal=np.array(pose[..., target, :2], np.float32),
        desired_goal=np.array(goal, np.float32),
    )
