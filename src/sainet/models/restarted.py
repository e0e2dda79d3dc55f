"""The non-recurrent form (the paper's figure 2c): a model of a single step."""

import jax
import jax.numpy as jnp
from jax import lax

from sainet.models.dynamics import AbstractDynamics, Purpose
from sainet.runs.errors import BadInput
from sainet.scenes.controls import Controls, PathControls
from sainet.scenes.scene import Scene
from sainet.scenes.state import State, Trajectory


class Restarted(AbstractDynamics):
    """Restarts a model, engine and push frame, from its own prediction at every step.

    Only for a pusher that follows a path: where a force drives it, no model but the
    engine knows where it is when the next step begins.
    """

    model: AbstractDynamics

    @property
    def made_for(self) -> Purpose | None:
        """What the network in the model was made for."""
        return self.model.made_for

    def begin(self, scene: Scene, state: State) -> State:
        """Start at the state; nothing else is remembered."""
        return state

    def advance(
        self, scene: Scene, carry: State, controls: Controls
    ) -> tuple[State, Trajectory]:
        """Apply the model to one step after another.

        Raises:
            BadInput: a force drives the pusher.
        """
        if not isinstance(controls, PathControls):
            raise BadInput(
                "A network of single steps predicts pushes of the robot setup alone: "
                "it cannot know where a pusher is that a force drives."
            )

        def step(state: State, control: PathControls) -> tuple[State, State]:
            begun = self.model.begin(scene, state)
            _, trajectory = self.model.advance(scene, begun, control)
            return trajectory.final, trajectory.final

        # Time first, each step with a time axis of one.
        each = jax.tree.map(lambda x: jnp.moveaxis(x, 1, 0)[:, :, None], controls)
        final, states = lax.scan(step, carry, each)
        return final, Trajectory(jax.tree.map(lambda x: jnp.moveaxis(x, 0, 1), states))
