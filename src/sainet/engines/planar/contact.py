"""Coulomb contact between two bodies, without restitution.

A contact constrains the relative velocity: separate bodies may close their gap within
the step, but not overlap; overlapping bodies move apart by a fixed fraction of the
overlap per step.
"""

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array

from sainet.engines.planar.table import Twist


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
