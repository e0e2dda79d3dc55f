"""Structure of arrays: one array over the batch for each number of each body.

The pusher is the last body. XLA fuses elementwise code on whole batches into one
vectorised loop, which makes the engine fast.
"""

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array

from sainet.scenes.scene import GRAVITY, Scene
from sainet.scenes.state import State

Scalars = tuple[Array, ...]  # one array of the batch's shape for each body


class Bodies(NamedTuple):
    """Poses and velocities of the disks and, last, of the pusher."""

    x: Scalars  # m
    y: Scalars  # m
    angle: Scalars  # rad
    velocity_x: Scalars  # m/s
    velocity_y: Scalars  # m/s
    spin: Scalars  # rad/s


class Properties(NamedTuple):
    """Properties of each body for the solver; the pusher is last."""

    radius: Scalars  # m
    inverse_mass: Scalars  # 1/kg
    inverse_inertia: Scalars  # 1/(kg m^2)
    weight: Scalars  # N, disks only
    arm: Scalars  # m, lever arm of table friction torque, disks only
    disk_friction: Array
    pusher_friction: Array
    table_friction: Array


def to_bodies(state: State) -> Bodies:
    """Return a state as one array per number and body."""
    still = jnp.zeros_like(state.pusher_position[..., 0])
    return Bodies(
        x=(*_last(state.position[..., 0]), state.pusher_position[..., 0]),
        y=(*_last(state.position[..., 1]), state.pusher_position[..., 1]),
        angle=(*_last(state.angle), still),
        velocity_x=(*_last(state.velocity[..., 0]), state.pusher_velocity[..., 0]),
        velocity_y=(*_last(state.velocity[..., 1]), state.pusher_velocity[..., 1]),
        spin=(*_last(state.spin), still),
    )


def to_state(bodies: Bodies) -> State:
    """Return the state of bodies; the inverse of `to_bodies`."""
    return State(
        position=_pairs(bodies.x[:-1], bodies.y[:-1]),
        angle=jnp.stack(bodies.angle[:-1], axis=-1),
        velocity=_pairs(bodies.velocity_x[:-1], bodies.velocity_y[:-1]),
        spin=jnp.stack(bodies.spin[:-1], axis=-1),
        pusher_position=jnp.stack([bodies.x[-1], bodies.y[-1]], axis=-1),
        pusher_velocity=jnp.stack(
            [bodies.velocity_x[-1], bodies.velocity_y[-1]], axis=-1
        ),
    )


def to_properties(
    scene: Scene, pressure_radius_ratio: float | Array, pusher_inverse_mass: float
) -> Properties:
    """Return the properties; contacts do not move a pusher that follows a path."""
    none = jnp.zeros_like(scene.pusher_radius)
    mass, radius = _last(scene.mass), _last(scene.radius)
    return Properties(
        radius=(*radius, scene.pusher_radius),
        inverse_mass=(*(1 / m for m in mass), none + pusher_inverse_mass),
        inverse_inertia=(
            *(2 / (m * r * r) for m, r in zip(mass, radius, strict=True)),
            none,
        ),
        weight=tuple(m * GRAVITY for m in mass),
        arm=tuple(r * pressure_radius_ratio for r in radius),
        disk_friction=scene.disk_friction,
        pusher_friction=scene.pusher_friction,
        table_friction=scene.table_friction,
    )


def _last(values: Array) -> Scalars:
    return tuple(values[..., body] for body in range(values.shape[-1]))


def _pairs(x: Scalars, y: Scalars) -> Array:
    return jnp.stack([jnp.stack(x, axis=-1), jnp.stack(y, axis=-1)], axis=-1)
