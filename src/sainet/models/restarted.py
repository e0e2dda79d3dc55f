"""The non-recurrent form (the paper's figure 2c): a model of single steps."""

import jax
import jax.numpy as jnp
from jax import lax

from sainet.models.correctors.base import Purpose
from sainet.models.dynamics import AbstractDynamics
from sainet.runs.errors import BadInput
from sainet.scenes.controls import Controls
from sainet.scenes.scene import Scene
from sainet.scenes.state import State, Trajectory


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
        self,
        scene: Scene,
        carry: State,
        controls: Controls,
        simulated: Trajectory | None = None,
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
