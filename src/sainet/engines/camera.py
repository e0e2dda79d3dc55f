"""An engine for a robot and a camera that do not agree about where things are."""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from sainet.engines.base import AbstractEngine
from sainet.pushes import Controls, move_pusher
from sainet.scene import Scene, State, Trajectory


class OffsetCamera(AbstractEngine):
    """Wraps an engine: the camera sees all things moved from where the robot has them.

    It is the camera that says where the disks are, and the robot where the pusher is.
    The wrapped engine is shown the pusher as the camera would see it; states that are
    returned have it where the robot does.
    """

    engine: AbstractEngine
    x_mm: float | Float[Array, ""]  # camera minus robot, on the table
    y_mm: float | Float[Array, ""]

    @property
    def on_host(self) -> bool:
        """Whether the wrapped engine works outside JAX."""
        return self.engine.on_host

    def rollout(self, scene: Scene, initial: State, controls: Controls) -> Trajectory:
        """Roll the wrapped engine out with the pusher where the camera would see it."""
        offset = jnp.stack([jnp.asarray(self.x_mm), jnp.asarray(self.y_mm)]) / 1000
        seen = move_pusher(initial, controls, offset)
        trajectory = self.engine.rollout(scene, *seen)
        pusher = trajectory.states.pusher_position
        return eqx.tree_at(
            lambda t: t.states.pusher_position,
            trajectory,
            pusher - jnp.broadcast_to(offset, pusher.shape),
        )
