"""What every task can say of a state."""

from abc import abstractmethod

import equinox as eqx
from jaxtyping import Array, Bool, Float

from sainet.scenes.scene import Scene
from sainet.scenes.state import State


class AbstractTask(eqx.Module):
    """Judges states; all arguments share their leading batch axes."""

    @abstractmethod
    def distance(self, state: State) -> Float[Array, "*batch"]:
        """Return how far the task is from being solved (m)."""

    @abstractmethod
    def cost(self, state: State) -> Float[Array, "*batch"]:
        """Return what a planner should make small: the distance, and more."""

    @abstractmethod
    def is_solved(self, scene: Scene, state: State) -> Bool[Array, "*batch"]:
        """Return whether nothing is left to do."""
