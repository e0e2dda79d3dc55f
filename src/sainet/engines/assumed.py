"""An engine that believes in fixed properties, whatever the scene is (the paper's)."""

from typing import Any

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from sainet.engines import CALIBRATED
from sainet.engines.base import AbstractEngine
from sainet.scenes.controls import Controls
from sainet.scenes.scene import Scene
from sainet.scenes.state import State, Trajectory

PAPER_MASS = (0.896, 1.1)  # kg
PAPER_RADIUS = (0.0525, 0.058)  # m
PAPER_FRICTION = 0.15


class AssumedProperties(AbstractEngine):
    """Wraps an engine and replaces the properties of the scene by assumed ones.

    Disks are not re-seated: where an assumed radius differs from the true one, they
    overlap or leave a gap at the start, and the engine has to deal with it. A field
    of friction is never assumed. A body beyond the listed ones gets their mean.
    """

    engine: AbstractEngine
    mass: tuple[float, ...] | None = eqx.field(static=True, default=PAPER_MASS)
    radius: tuple[float, ...] | None = eqx.field(static=True, default=PAPER_RADIUS)
    friction: float | None = eqx.field(static=True, default=PAPER_FRICTION)
    pusher_friction: float | None = eqx.field(static=True, default=None)
    disk_friction: float | None = eqx.field(static=True, default=None)

    def assume(self, scene: Scene) -> Scene:
        """Return the scene as this engine believes it to be; None keeps the truth."""
        return Scene(
            mass=_replace(scene.mass, self.mass),
            radius=_replace(scene.radius, self.radius),
            table_friction=_fill(scene.table_friction, self.friction),
            disk_friction=_fill(scene.disk_friction, self.disk_friction),
            pusher_friction=_fill(scene.pusher_friction, self.pusher_friction),
            pusher_radius=scene.pusher_radius,
            time_step=scene.time_step,
        )

    @property
    def on_host(self) -> bool:
        """Whether the wrapped engine works outside JAX."""
        return self.engine.on_host

    def rollout(self, scene: Scene, initial: State, controls: Controls) -> Trajectory:
        """Roll the wrapped engine out in the assumed scene."""
        return self.engine.rollout(self.assume(scene), initial, controls)


def beliefs(name: str) -> dict[str, Any]:
    """Return what an assumed engine of that name believes; None is the truth."""
    known = name.endswith(CALIBRATED)
    return {
        "mass": None if known else PAPER_MASS,
        "radius": None if known else PAPER_RADIUS,
        "friction": PAPER_FRICTION,
    }


def calibrated(engine: AbstractEngine) -> AssumedProperties:
    """Wrap an engine that knows the true masses and radii, but not the friction."""
    return AssumedProperties(engine, **beliefs(CALIBRATED))


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
