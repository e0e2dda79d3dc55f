"""Friction between a pressed disk and the table.

The limit surface (Goyal, Ruina and Papadopoulos 1991) is approximated by an ellipsoid:
friction force f and torque tau satisfy ``(f / F)^2 + (tau / (F c))^2 <= 1`` with
``F = mu m g`` and c the mean distance of the pressure from the centre, 2/3 of the
radius for uniform pressure. Friction follows the principle of maximum dissipation.
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
