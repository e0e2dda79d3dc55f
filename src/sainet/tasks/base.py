"""The interface of tasks."""

from abc import abstractmethod

import equinox as eqx
from jaxtyping import Array, Bool, Float

from sainet.scenes.scene import Scene
from sainet.scenes.state import State


class AbstractTask(eqx.Module):
    """A task that the robot has to solve; arguments share their leading batch axes."""

    @abstractmethod
    def distance(self, state: State) -> Float[Array, "*batch"]:
        """Return the remaining distance (m)."""

    @abstractmethod
    def cost(self, state: State) -> Float[Array, "*batch"]:
        """Return the cost that planners minimise (m)."""

    @abstractmethod
    def is_solved(self, scene: Scene, state: State) -> Bool[Array, "*batch"]:
        """Return whether the task is solved."""
