"""Models for a robot and a camera that do not agree about where things are."""

from typing import Any

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from sainet.models.correctors.base import Purpose
from sainet.models.dynamics import AbstractDynamics
from sainet.scenes.camera import CameraOffset
from sainet.scenes.controls import Controls, move_controls, move_pusher
from sainet.scenes.scene import Scene
from sainet.scenes.state import State, Trajectory


class OffsetCamera(AbstractDynamics):
    """Wraps a model: the camera sees all things moved from where the robot has them.

    It is the camera that says where the disks are, and the robot where the pusher is.
    The wrapped model, network and engine, is shown the pusher as the camera would see
    it; states that are returned have it where the robot does.
    """

    dynamics: AbstractDynamics
    offset: CameraOffset = eqx.field(static=True)

    @property
    def on_host(self) -> bool:
        """Whether the wrapped model has an engine that works outside JAX."""
        return self.dynamics.on_host

    @property
    def made_for(self) -> Purpose | None:
        """What the network in the wrapped model was made for."""
        return self.dynamics.made_for

    def begin(self, scene: Scene, state: State) -> Any:  # noqa: ANN401
        """Start at the state."""
        return self.dynamics.begin(scene, move_pusher(state, self._offset))

    def advance(
        self,
        scene: Scene,
        carry: Any,  # noqa: ANN401
        controls: Controls,
        simulated: Trajectory | None = None,
    ) -> tuple[Any, Trajectory]:
        """Advance the wrapped model."""
        seen = move_controls(controls, self._offset)
        carry, trajectory = self.dynamics.advance(scene, carry, seen, simulated)
        return carry, Trajectory(move_pusher(trajectory.states, -self._offset))

    @property
    def _offset(self) -> Float[Array, "2"]:
        return jnp.array(self.offset.vector)


def with_camera(dynamics: AbstractDynamics, offset: CameraOffset) -> AbstractDynamics:
    """Return a model that takes the offset of the camera into account, if any."""
    return OffsetCamera(dynamics, offset) if offset else dynamics
