"""Models with a camera offset: robot and camera measure different positions."""

from typing import Any

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from sainet.models.correctors.base import Purpose
from sainet.models.dynamics import AbstractDynamics
from sainet.scenes.camera import CameraOffset
from sainet.scenes.controls import Controls
from sainet.scenes.scene import Scene
from sainet.scenes.state import State, Trajectory


class OffsetCamera(AbstractDynamics):
    """Wrapper that converts pusher positions between robot and camera coordinates.

    The camera measures the disks, the robot the pusher. The wrapped model receives the
    pusher position in camera coordinates; returned states have it in robot coordinates.
    """

    dynamics: AbstractDynamics
    offset: CameraOffset = eqx.field(static=True)

    @property
    def on_host(self) -> bool:
        """Whether the wrapped model has an engine that runs outside JAX."""
        return self.dynamics.on_host

    @property
    def made_for(self) -> Purpose | None:
        """The purpose of the network in the wrapped model; None without a network."""
        return self.dynamics.made_for

    def begin(self, scene: Scene, state: State) -> Any:  # noqa: ANN401
        """Return the carry of the wrapped model at the state."""
        return self.dynamics.begin(scene, state.with_pusher_moved(self._offset))

    def advance(
        self,
        scene: Scene,
        carry: Any,  # noqa: ANN401
        controls: Controls,
        simulated: Trajectory | None = None,
    ) -> tuple[Any, Trajectory]:
        """Return the carry and the states after each step of the wrapped model."""
        moved = controls.moved(self._offset)
        carry, trajectory = self.dynamics.advance(scene, carry, moved, simulated)
        return carry, Trajectory(trajectory.states.with_pusher_moved(-self._offset))

    @property
    def _offset(self) -> Float[Array, "2"]:
        return jnp.array(self.offset.vector)


def with_camera(dynamics: AbstractDynamics, offset: CameraOffset) -> AbstractDynamics:
    """Return a model that takes the offset of the camera into account, if any."""
    return OffsetCamera(dynamics, offset) if offset else dynamics
