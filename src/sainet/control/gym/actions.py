"""Actions: which numbers stand for which pushes."""

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, Any, Literal

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float, Shaped

from sainet.runs.errors import BadSetting
from sainet.scenes.pushes import Push, PushGrid

if TYPE_CHECKING:
    import gymnasium

ActionKind = Literal["grid", "continuous"]
Action = int | np.integer | Float[np.ndarray, "2"]


class AbstractActions(ABC):
    """The actions of an environment; each is a push of the paper's stroke and speed."""

    grid = PushGrid()

    @property
    @abstractmethod
    def space(self) -> "gymnasium.Space[Any]":
        """The space of one action."""

    @abstractmethod
    def pushes(self, action: object, shape: tuple[int, ...] = ()) -> Push:
        """Return the pushes of an action, or of a batch of actions.

        Args:
            action: an action of the space, or an array of actions.
            shape: of the batch; empty: one action.

        Raises:
            BadSetting: an action is outside the space.
        """

    @abstractmethod
    def action(self, push: Push) -> Action:
        """Return the action that stands for a push, or for the nearest push."""


class GridActions(AbstractActions):
    """The 72 pushes by their index in `PushGrid`, the directions running fastest."""

    def __init__(self) -> None:
        """List the pushes."""
        self._pushes: Push = jax.device_get(self.grid.pushes())

    @property
    def space(self) -> "gymnasium.Space[Any]":
        """The indices of all pushes."""
        from sainet.control.gym.extra import gymnasium

        return gymnasium.spaces.Discrete(len(self._pushes.length))

    def pushes(self, action: object, shape: tuple[int, ...] = ()) -> Push:
        """Return the pushes with these indices."""
        count, index = len(self._pushes.length), _array(action)
        whole = index.dtype.kind in "iu" and index.shape == shape
        if not (whole and (index >= 0).all() and (index < count).all()):
            wanted = f"{_each(shape)}a whole number from 0 to {count - 1}"
            raise BadSetting("action", action, wanted)
        return jax.tree.map(lambda x: x[index], self._pushes)

    def action(self, push: Push) -> int:
        """Return the index of the push."""
        contact = abs(self._pushes.contact_angle - push.contact_angle)
        direction = abs(self._pushes.direction - push.direction)
        return int(np.argmin(contact + direction))


class ContinuousActions(AbstractActions):
    """Contact angle and push direction, as fractions of their largest values.

    1 stands for a contact angle of 60 degrees, or a push direction of 30 degrees, to
    the left (counter-clockwise); -1 for the same to the right.
    """

    @property
    def space(self) -> "gymnasium.Space[Any]":
        """Both fractions, from -1 to 1."""
        from sainet.control.gym.extra import gymnasium

        return gymnasium.spaces.Box(-1.0, 1.0, (2,), np.float32)

    @property
    def _largest(self) -> Float[np.ndarray, "2"]:
        """The angles that 1 stands for (rad)."""
        grid = self.grid
        return np.array([grid.contact_range, grid.direction_range], np.float32)

    def pushes(self, action: object, shape: tuple[int, ...] = ()) -> Push:
        """Return the pushes with these fractions."""
        fraction = _array(action)
        good = fraction.dtype.kind in "iuf" and fraction.shape == (*shape, 2)
        if not (good and (np.abs(fraction) <= 1).all()):  # also NaN
            wanted = f"{_each(shape)}two numbers from -1 to 1"
            raise BadSetting("action", action, wanted)
        angle = jnp.asarray(fraction.astype(np.float32) * self._largest)
        return Push(
            contact_angle=angle[..., 0],
            direction=angle[..., 1],
            length=jnp.full(shape, self.grid.length),
            speed=jnp.full(shape, self.grid.speed),
        )

    def action(self, push: Push) -> Float[np.ndarray, "2"]:
        """Return the fractions of the push."""
        angle = np.array([push.contact_angle, push.direction], np.float32)
        return np.clip(angle / self._largest, -1, 1)


ACTIONS: dict[ActionKind, type[AbstractActions]] = {
    "grid": GridActions,
    "continuous": ContinuousActions,
}


def _array(action: object) -> Shaped[np.ndarray, "..."]:
    """Return an action as an array; one of objects if its parts differ in shape."""
    try:
        return np.asarray(action)
    except ValueError:
        return np.array(None)


def _each(shape: tuple[int, ...]) -> str:
    return f"{shape[0]} actions, each " if shape else ""
