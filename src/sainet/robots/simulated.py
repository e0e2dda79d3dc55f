"""A robot in a simulated world: noise of motion and of sight, and a rough table."""

from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from sainet.engines.base import AbstractEngine, roll_out
from sainet.robots.base import AbstractRobot
from sainet.scenes.controls import PathControls
from sainet.scenes.pushes import Push, command_path
from sainet.scenes.recording import Recording
from sainet.scenes.scene import FrictionField, Scene
from sainet.scenes.shapes import pusher_gaps
from sainet.scenes.state import State, at_rest
from sainet.worlds.noise import capture_error, friction_features, tracking_error
from sainet.worlds.noise_config import NoiseConfig

PUSH_STEPS = 200  # 48 of motion; then the pusher holds while the disks come to rest


class SimulatedRobot(AbstractRobot):
    """Executes pushes in an engine, with the noise of the simulated world.

    Nothing simulated is real: it stands for a robot in tests and comparisons.
    """

    def __init__(
        self,
        engine: AbstractEngine,
        scene: Scene,
        state: State,
        *,
        noise: NoiseConfig,
        rng: np.random.Generator,
    ) -> None:
        """Put the disks on the table.

        Args:
            engine: moves them.
            scene: one scene with the true properties.
            state: where they begin.
            noise: sizes of the sources.
            rng: draws the noise.
        """
        self._engine, self._noise, self._rng = engine, noise, rng
        self.scene = _with_rough_table(scene, noise, rng)
        self.truth = state
        self._seen = self.truth

    def observe(self) -> State:
        """Return the poses as motion capture sees them; velocities are zero."""
        bodies = self.truth.angle.shape[0]
        error = capture_error(self._rng, (1, 1, bodies), self._noise)[0, 0]
        self._seen = replace(
            self.truth,
            position=self.truth.position + jnp.asarray(error[:, :2], jnp.float32),
            angle=self.truth.angle + jnp.asarray(error[:, 2], jnp.float32),
        )
        return self._seen

    def push(self, push: Push) -> Recording:
        """Push from where the disks were last observed."""
        # In the engine's batches: one scene, one push.
        scene, seen, truth, one = jax.tree.map(
            lambda x: jnp.asarray(x)[None], (self.scene, self._seen, self.truth, push)
        )
        plain = eqx.tree_at(lambda s: s.friction_field, scene, None)
        planned, controls = command_path(plain, seen, one, steps=PUSH_STEPS)
        initial = at_rest(truth.position, truth.angle, planned.pusher_position)
        states = roll_out(self._engine, scene, initial, self._disturb(controls)).states
        end = jax.tree.map(lambda x: x[0, -1], states)
        self.truth = at_rest(end.position, end.angle, end.pusher_position)
        before, after = jax.tree.map(lambda x: np.asarray(x)[0], (initial, states))
        pose = np.concatenate([_pose(before)[None], _pose(after)])
        path = [before.pusher_position[None], after.pusher_position]
        return Recording(
            time=scene.time_step * np.arange(len(pose)),
            pose=pose,
            pusher=np.concatenate(path),
            commanded=push,
            trouble=_start_trouble(plain, initial) or _trouble(pose),
        )

    def _disturb(self, controls: PathControls) -> PathControls:
        moving = np.abs(np.asarray(controls.velocity)).max(axis=-1) > 0
        step = self.scene.time_step
        error = tracking_error(self._rng, moving, self._noise, step)
        return PathControls(
            controls.position + jnp.asarray(error, jnp.float32), controls.velocity
        )


_STILL = 1e-4  # m
_DEEPEST = 1e-3  # m, more than the noise of motion capture


def _pose(state: State) -> Float[np.ndarray, "*batch body 3"]:
    return np.concatenate([state.position, state.angle[..., None]], axis=-1)


def _start_trouble(scene: Scene, initial: State) -> str:
    """Return whether the pusher starts inside another disk than the pushed one."""
    depth = -np.asarray(pusher_gaps(scene, initial))[0, 1:]
    if not (depth > _DEEPEST).any():
        return ""
    disk = 2 + int(np.argmax(depth))
    return f"the pusher began {1000 * depth.max():.1f} mm inside disk {disk}"


def _trouble(pose: Float[np.ndarray, "sample body 3"]) -> str:
    """Return why a push that was executed is useless, empty if it is not."""
    if not np.isfinite(pose).all():
        return "simulation produced NaN or infinity"
    moved = np.linalg.norm(pose[-1, 0, :2] - pose[0, 0, :2])
    return "" if moved > _STILL else "disk 1 did not move"


def _with_rough_table(
    scene: Scene, noise: NoiseConfig, rng: np.random.Generator
) -> Scene:
    if not noise.friction_fraction:
        return scene
    features = friction_features(rng, 1, noise)
    field = FrictionField(
        **{k: jnp.asarray(v[0], jnp.float32) for k, v in features.items()}
    )
    return eqx.tree_at(
        lambda s: s.friction_field, scene, field, is_leaf=lambda x: x is None
    )
