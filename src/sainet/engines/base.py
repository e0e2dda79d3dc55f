"""The interface of engines, and the wrapper that substitutes assumed properties."""

from abc import abstractmethod

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from sainet.engines.simulator import PAPER, Assumptions
from sainet.scenes.controls import Controls
from sainet.scenes.quantities import MOST_DISKS
from sainet.scenes.scene import Scene
from sainet.scenes.state import State, Trajectory


class AbstractEngine(eqx.Module):
    """A physics engine, which simulates the motion of a scene under controls."""

    @abstractmethod
    def rollout(self, scene: Scene, initial: State, controls: Controls) -> Trajectory:
        """Return the states after each step of the controls (eq. 2: open loop).

        The final state is complete: two consecutive rollouts equal one long rollout.

        Args:
            scene: masses and radii [push, body] (kg, m); all arguments share their
                leading axes.
            initial: state before the first step, positions [push, body, 2] (m).
            controls: of the pusher, [push, time, 2] (m, or N).

        Returns:
            Positions [push, time, body, 2] (m), and the other fields of a state, after
            each step of ``scene.time_step`` seconds.
        """

    @property
    def on_host(self) -> bool:
        """Whether it runs outside JAX, so that its rollouts cannot be compiled."""
        return False

    @property
    def most_disks(self) -> int:
        """The largest number of disks that a scene may have."""
        return MOST_DISKS


def roll_out(
    engine: AbstractEngine, scene: Scene, initial: State, controls: Controls
) -> Trajectory:
    """Return the rollout of any engine, compiled once per set of shapes if possible."""
    if engine.on_host:
        return engine.rollout(scene, initial, controls)
    return _compiled(engine, scene, initial, controls)


@eqx.filter_jit
def _compiled(
    engine: AbstractEngine, scene: Scene, initial: State, controls: Controls
) -> Trajectory:
    return engine.rollout(scene, initial, controls)


class AssumedProperties(AbstractEngine):
    """Wraps an engine and replaces properties of the scene by assumed ones.

    Disks are not re-seated: where an assumed radius differs from the true one, they
    overlap or leave a gap at the start, and the engine has to deal with it. A friction
    field is never assumed.

    Attributes:
        engine: the wrapped engine.
        assumptions: masses (kg), radii (m) and frictions; None keeps those of a scene.
    """

    engine: AbstractEngine
    assumptions: Assumptions = eqx.field(static=True, default=PAPER)

    def assume(self, scene: Scene) -> Scene:
        """Return the scene with the assumed properties."""
        return with_assumptions(scene, self.assumptions)

    @property
    def on_host(self) -> bool:
        """Whether the wrapped engine works outside JAX."""
        return self.engine.on_host

    @property
    def most_disks(self) -> int:
        """The largest number of disks of the wrapped engine."""
        return self.engine.most_disks

    def rollout(self, scene: Scene, initial: State, controls: Controls) -> Trajectory:
        """Return the states in the assumed scene; see `AbstractEngine.rollout`."""
        return self.engine.rollout(self.assume(scene), initial, controls)


def with_assumptions(scene: Scene, assumed: Assumptions) -> Scene:
    """Return a scene with assumed properties, without a friction field."""
    return Scene(
        mass=_replace(scene.mass, assumed.mass),
        radius=_replace(scene.radius, assumed.radius),
        table_friction=_fill(scene.table_friction, assumed.table_friction),
        disk_friction=_fill(scene.disk_friction, assumed.disk_friction),
        pusher_friction=_fill(scene.pusher_friction, assumed.pusher_friction),
        pusher_radius=scene.pusher_radius,
        time_step=scene.time_step,
    )


def _fill(true: Array, assumed: float | None) -> Array:
    return true if assumed is None else jnp.full_like(true, assumed)


def _replace(
    true: Float[Array, "*batch body"], assumed: tuple[float, ...] | None
) -> Float[Array, "*batch body"]:
    if assumed is None:
        return true
    mean = sum(assumed) / len(assumed)
    count = true.shape[-1]
    values = (*assumed, *[mean] * count)[:count]
    return jnp.broadcast_to(jnp.array(values, true.dtype), true.shape)
