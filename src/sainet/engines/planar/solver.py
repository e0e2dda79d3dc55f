"""Velocities that satisfy all contacts and table friction at the end of a step.

Projected Gauss-Seidel with a fixed number of sweeps: each updates the table friction of
every disk and then every contact, starting from the latest impulses.
"""

from typing import NamedTuple

import jax.numpy as jnp
from jax import lax
from jaxtyping import Array

from sainet.engines.planar.bodies import Bodies, Properties
from sainet.engines.planar.contact import (
    Contact,
    ContactImpulse,
    Side,
    find_contact,
    solve_contact,
)
from sainet.engines.planar.table import TableImpulse, Twist, solve_table


class Step(NamedTuple):
    """Settings of a step that all constraints share."""

    time_step: float  # s
    recovery: float  # fraction of an overlap that is corrected per step
    sweeps: int


def solve_all_pairs(
    bodies: Bodies, properties: Properties, limits: tuple[Array, ...], step: Step
) -> tuple[Twist, ...]:
    """Return the bodies' velocities, with contacts between all pairs of bodies.

    Args:
        bodies: poses and velocities at the start of the step.
        properties: properties of the same bodies.
        limits: largest impulse of table friction on each disk, N s.
        step: settings of the step.
    """
    pairs = every_pair(len(bodies.x))
    contacts = [_static_contact(bodies, properties, pair, step) for pair in pairs]
    zero = jnp.zeros_like(bodies.x[0])
    disks = range(len(limits))

    def sweep(_: Array, carry: tuple) -> tuple:
        twists, table, touching = (list(part) for part in carry)
        for disk in disks:
            table[disk], twists[disk] = solve_table(
                table[disk],
                twists[disk],
                limit=limits[disk],
                arm=properties.arm[disk],
                inverse_mass=properties.inverse_mass[disk],
                inverse_inertia=properties.inverse_inertia[disk],
            )
        for k, (i, j) in enumerate(pairs):
            touching[k], twists[i], twists[j] = solve_contact(
                contacts[k], touching[k], twists[i], twists[j]
            )
        return tuple(twists), tuple(table), tuple(touching)

    start = (
        tuple(map(Twist, bodies.velocity_x, bodies.velocity_y, bodies.spin)),
        tuple(TableImpulse(zero, zero, zero) for _ in disks),
        tuple(ContactImpulse(zero, zero) for _ in pairs),
    )
    # Keep the loop: XLA compiles unrolled sweeps for minutes.
    return lax.fori_loop(0, step.sweeps, sweep, start)[0]


def every_pair(count: int) -> list[tuple[int, int]]:
    """Return all pairs, those of the pusher (the last body) first."""
    pusher = count - 1
    driven = [(pusher, disk) for disk in range(pusher)]
    return driven + [(i, j) for i in range(pusher) for j in range(i + 1, pusher)]


def _static_contact(
    bodies: Bodies, properties: Properties, pair: tuple[int, int], step: Step
) -> Contact:
    first, second = pair
    pusher = len(bodies.x) - 1
    return find_contact(
        (bodies.x[second] - bodies.x[first], bodies.y[second] - bodies.y[first]),
        _side(properties, first),
        _side(properties, second),
        friction=properties.pusher_friction
        if first == pusher
        else properties.disk_friction,
        time_step=step.time_step,
        recovery=step.recovery,
    )


def _side(properties: Properties, body: int) -> Side:
    return Side(
        radius=properties.radius[body],
        inverse_mass=properties.inverse_mass[body],
        inverse_inertia=properties.inverse_inertia[body],
    )
