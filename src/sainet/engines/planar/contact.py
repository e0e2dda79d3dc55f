"""Constraints of a step: friction on the table, and contact between two bodies.

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
