"""Models of a user's own: a function on NumPy arrays, or a file of predictions."""

from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from sainet.models.dynamics import AbstractDynamics, Given
from sainet.models.identity import ModelId
from sainet.models.model import Model
from sainet.runs.errors import BadInput, require
from sainet.scenes.controls import Controls
from sainet.scenes.scene import Scene
from sainet.scenes.state import State, Trajectory

Predict = Callable[[Scene, State, Any], np.ndarray]
_TIMED = 3  # axes of an array with time: push, time, xy


class Begun(eqx.Module):
    """The start of pushes, and their controls so far."""

    initial: State
    controls: Controls | None = None

    def with_more(self, controls: Controls) -> Controls:
        """Return the controls so far, continued."""
        if self.controls is None:
            return controls

        def joined(one: Any, other: Any) -> Any:  # noqa: ANN401
            return jnp.concatenate([one, other], 1) if one.ndim == _TIMED else one

        return jax.tree.map(joined, self.controls, controls)


class FunctionDynamics(AbstractDynamics):
    """A function on NumPy arrays that predicts the poses of whole pushes."""

    function: Predict
    name: str = eqx.field(static=True)

    @property
    def on_host(self) -> bool:
        """True: it runs outside JAX."""
        return True

    def begin(self, scene: Scene, state: State) -> Begun:
        """Start at the state."""
        return Begun(state)

    def advance(
        self, scene: Scene, carry: Begun, controls: Controls, simulated: Given = None
    ) -> tuple[Begun, Trajectory]:
        """Predict the push from its start; return the steps of these controls."""
        del simulated
        whole = carry.with_more(controls)
        poses = self._poses(scene, carry.initial, whole)
        start = np.asarray(carry.initial.pose)[:, None]
        rates = np.diff(poses, axis=1, prepend=start) / scene.time_step
        path, velocity = whole.pusher_motion(carry.initial.pusher_position)
        states = State(
            position=jnp.asarray(poses[..., :2], jnp.float32),
            angle=jnp.asarray(poses[..., 2], jnp.float32),
            velocity=jnp.asarray(rates[..., :2], jnp.float32),
            spin=jnp.asarray(rates[..., 2], jnp.float32),
            pusher_position=path,
            pusher_velocity=velocity,
        )
        new = controls.command.shape[1]
        found = Trajectory(jax.tree.map(lambda x: x[:, -new:], states))
        return Begun(carry.initial, whole), found

    def _poses(self, scene: Scene, initial: State, controls: Controls) -> np.ndarray:
        given = jax.tree.map(np.asarray, (scene, initial, controls))
        found = self.function(*given)
        try:
            poses = np.asarray(found)
        except ValueError:  # rows of different lengths
            poses = np.array(None)
        pushes, steps = controls.command.shape[:2]
        wanted = (pushes, steps, initial.body_count, 3)
        if poses.shape != wanted:
            raise BadInput(
                f"{self.name}: its function returns the shape {list(poses.shape)}; it "
                f"must be {list(wanted)}: push, time, body, pose (m, m, rad)."
            )
        if poses.dtype.kind != "f":  # whole numbers of metres are no poses
            raise BadInput(
                f"{self.name}: its function returns numbers of the type {poses.dtype}; "
                "it must return floating-point numbers (m, m, rad)."
            )
        return poses


def from_function(function: Predict, *, name: str) -> Model:
    """Return a model that predicts with a function of your own on NumPy arrays.

    It is evaluated and plans beside the models of the package: `evaluate`, `run_trials`
    and planners take it.

    Example: disk 1 moves as the pusher does::

        def predict(scene, initial, controls):
            moved = controls.position - initial.pusher_position[:, None]
            poses = np.zeros((*moved.shape[:2], initial.body_count, 3))
            poses[..., :2] = initial.position[:, None]
            poses[..., 2] = initial.angle[:, None]
            poses[:, :, 0, :2] += moved
            return poses

        carried = sn.from_function(predict, name="carried")

    A PyTorch module predicts through such a function::

        @torch.no_grad()
        def predict(scene, initial, controls):
            inputs = (scene.mass, scene.radius, initial.position, controls.position)
            return module(*map(torch.tensor, inputs)).numpy()

    Args:
        function: `function(scene, initial, controls)` returns the poses (m, m, rad)
            after each step, [push, time, body, 3]. It is given NumPy arrays with a
            leading axis, push: `scene.mass`, `scene.radius` [push, body] (kg, m),
            `initial.position` [push, body, 2] (m), `initial.angle` [push, body] (rad),
            `initial.pusher_position` [push, 2] (m), `controls.position` [push, time, 2]
            (m), where the pusher is to be after each step, and `controls.velocity`
            (m/s). A later step must not change an earlier pose.
        name: of the model in tables.
    """
    require(callable(function), "function", "a function", function)
    return Model(ModelId(kind="physics", name=name), FunctionDynamics(function, name))
