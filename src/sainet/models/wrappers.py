"""Wrappers of models: a camera offset, and a restart at every step."""

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, Float

from sainet.models.correctors import Purpose, Region
from sainet.models.dynamics import AbstractDynamics, Carry, Given
from sainet.runs.errors import BadInput
from sainet.scenes.controls import Controls
from sainet.scenes.recording import CameraOffset
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

    @property
    def has_regions(self) -> bool:
        """Whether the wrapped model states regions."""
        return self.dynamics.has_regions

    @property
    def engine_alone(self) -> AbstractDynamics | None:
        """The engine inside the wrapped model, with the same camera."""
        alone = self.dynamics.engine_alone
        return alone and OffsetCamera(alone, self.offset)

    def begin(self, scene: Scene, state: State) -> Carry:
        """Return the carry of the wrapped model at the state."""
        return self.dynamics.begin(scene, state.with_pusher_moved(self._offset))

    def advance(
        self, scene: Scene, carry: Carry, controls: Controls, simulated: Given = None
    ) -> tuple[Carry, Trajectory]:
        """Return the carry and the states after each step of the wrapped model."""
        moved = controls.moved(self._offset)
        carry, trajectory = self.dynamics.advance(scene, carry, moved, simulated)
        return carry, Trajectory(trajectory.states.with_pusher_moved(-self._offset))

    def region(self, scene: Scene, state: State, controls: Controls) -> Region | None:
        """Return the regions of the wrapped model."""
        moved = state.with_pusher_moved(self._offset), controls.moved(self._offset)
        return self.dynamics.region(scene, *moved)

    @property
    def _offset(self) -> Float[Array, "2"]:
        return jnp.array(self.offset.vector)


def with_camera(dynamics: AbstractDynamics, offset: CameraOffset) -> AbstractDynamics:
    """Return a model that takes the offset of the camera into account, if any."""
    return OffsetCamera(dynamics, offset) if offset else dynamics


class Restarted(AbstractDynamics):
    """Restarts a model, engine and push frame, from its own prediction at every step.

    Only for a pusher that follows a path: where a force drives it, only an engine
    predicts its position at the start of the next step.
    """

    model: AbstractDynamics

    @property
    def made_for(self) -> Purpose | None:
        """The pushes that the model's network is for."""
        return self.model.made_for

    def begin(self, scene: Scene, state: State) -> State:
        """Start at the state."""
        return state

    def advance(
        self, scene: Scene, carry: State, controls: Controls, simulated: Given = None
    ) -> tuple[State, Trajectory]:
        """Apply the model to one step after another; its engine always runs.

        Raises:
            BadInput: a force drives the pusher.
        """
        del simulated  # of a whole push; here the engine restarts at every step
        if controls.pusher_path is None:
            raise BadInput(
                "A network of single steps predicts only pushes of the robot setup: "
                "the path of a pusher that a force drives is not known in advance."
            )

        def step(state: State, control: Controls) -> tuple[State, State]:
            begun = self.model.begin(scene, state)
            _, trajectory = self.model.advance(scene, begun, control)
            return trajectory.final, trajectory.final

        # Time first, each step with a time axis of one.
        each = jax.tree.map(lambda x: jnp.moveaxis(x, 1, 0)[:, :, None], controls)
        final, states = lax.scan(step, carry, each)
        return final, Trajectory(jax.tree.map(lambda x: jnp.moveaxis(x, 0, 1), states))
