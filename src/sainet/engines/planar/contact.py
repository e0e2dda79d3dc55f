"""Bodies as arrays, and the constraints of a step: table friction and contacts.

**Bodies.** A structure of arrays: one array over the batch for each number of each
body, the pusher last. XLA fuses elementwise code on whole batches into one vectorised
loop, which makes the engine fast.

**Table.** The limit surface (Goyal, Ruina and Papadopoulos 1991) is approximated by an
ellipsoid: friction force f and torque tau satisfy ``(f / F)^2 + (tau / (F c))^2 <= 1``
with ``F = mu m g`` and c the mean distance of the pressure from the centre, 2/3 of the
radius for uniform pressure. Friction follows the principle of maximum dissipation.

**Contact.** Coulomb friction without restitution. A contact constrains the relative
velocity: separate bodies may close their gap within the step, but not overlap;
overlapping bodies move apart by a fixed fraction of the overlap per step.
"""

from typing import NamedTuple

import jax.numpy as jnp
from jax import lax
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


class TableImpulse(NamedTuple):
    """Friction impulse on a disk during a step; the torque is divided by its arm."""

    x: Array  # N s
    y: Array  # N s
    turn: Array  # N s


class Twist(NamedTuple):
    """Velocity and spin of a disk."""

    x: Array  # m/s
    y: Array  # m/s
    spin: Array  # rad/s


def solve_table(
    impulse: TableImpulse,
    twist: Twist,
    *,
    limit: Array,
    arm: Array,
    inverse_mass: Array,
    inverse_inertia: Array,
) -> tuple[TableImpulse, Twist]:
    """Return a disk's friction impulse and velocity after one update.

    In the coordinates (f, tau / c) the ellipsoid is a ball of radius `limit` (N s), so
    the projection is a scaling and the fixed point has maximum dissipation. The gain is
    the largest that is stable in both translation and rotation.
    """
    response = jnp.maximum(inverse_mass, arm * arm * inverse_inertia)
    gain = 1 / response
    x = impulse.x - gain * twist.x
    y = impulse.y - gain * twist.y
    turn = impulse.turn - gain * arm * twist.spin
    size = x * x + y * y + turn * turn
    # The bounds keep both the value and the gradient finite for a disk at rest.
    inside = limit * lax.rsqrt(jnp.maximum(size, jnp.maximum(limit * limit, 1e-30)))
    new = TableImpulse(x * inside, y * inside, turn * inside)
    moved = Twist(
        x=twist.x + inverse_mass * (new.x - impulse.x),
        y=twist.y + inverse_mass * (new.y - impulse.y),
        spin=twist.spin + inverse_inertia * arm * (new.turn - impulse.turn),
    )
    return new, moved


class Contact(NamedTuple):
    """Possible contact of two bodies in a step, with their response to impulses."""

    normal_x: Array  # from the first body to the second
    normal_y: Array
    least_speed: Array  # m/s, smallest separating velocity along the normal
    normal_mass: Array  # kg
    tangent_mass: Array  # kg
    friction: Array
    first: "Side"
    second: "Side"


class Side(NamedTuple):
    """Properties of one body of a contact."""

    radius: Array  # m
    inverse_mass: Array  # 1/kg
    inverse_inertia: Array  # 1/(kg m^2)


class ContactImpulse(NamedTuple):
    """Impulse of a contact during a step."""

    normal: Array  # N s
    tangent: Array  # N s


def find_contact(
    offset: tuple[Array, Array],
    first: Side,
    second: Side,
    *,
    friction: Array,
    time_step: float,
    recovery: float,
) -> Contact:
    """Return the contact of two bodies with the given offset of their centres (m)."""
    x, y = offset
    distance = jnp.sqrt(jnp.maximum(x * x + y * y, 1e-18))
    gap = distance - first.radius - second.radius
    inverse_mass = first.inverse_mass + second.inverse_mass
    turning = (
        first.radius**2 * first.inverse_inertia
        + second.radius**2 * second.inverse_inertia
    )
    return Contact(
        normal_x=x / distance,
        normal_y=y / distance,
        least_speed=-gap / time_step * jnp.where(gap > 0, 1.0, recovery),
        normal_mass=1 / inverse_mass,
        tangent_mass=1 / (inverse_mass + turning),
        friction=friction,
        first=first,
        second=second,
    )


def solve_contact(
    contact: Contact, impulse: ContactImpulse, first: Twist, second: Twist
) -> tuple[ContactImpulse, Twist, Twist]:
    """Return a contact's impulse and its bodies' velocities after one update."""
    nx, ny = contact.normal_x, contact.normal_y
    x, y = second.x - first.x, second.y - first.y
    parting = x * nx + y * ny
    slipping = (
        y * nx
        - x * ny
        - first.spin * contact.first.radius
        - second.spin * contact.second.radius
    )
    normal = impulse.normal - contact.normal_mass * (parting - contact.least_speed)
    normal = jnp.maximum(normal, 0.0)
    limit = contact.friction * normal
    tangent = impulse.tangent - contact.tangent_mass * slipping
    tangent = jnp.minimum(jnp.maximum(tangent, -limit), limit)
    along, across = normal - impulse.normal, tangent - impulse.tangent
    push_x, push_y = along * nx - across * ny, along * ny + across * nx
    return (
        ContactImpulse(normal, tangent),
        _move(first, contact.first, -push_x, -push_y, across),
        _move(second, contact.second, push_x, push_y, across),
    )


def _move(twist: Twist, side: Side, x: Array, y: Array, across: Array) -> Twist:
    # A tangential impulse rotates both bodies in the same sense: arms are opposite.
    return Twist(
        x=twist.x + side.inverse_mass * x,
        y=twist.y + side.inverse_mass * y,
        spin=twist.spin - side.inverse_inertia * side.radius * across,
    )
