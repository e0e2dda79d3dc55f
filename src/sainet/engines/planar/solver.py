"""Velocities that satisfy all contacts and table friction at the end of a step.

Projected Gauss-Seidel with a fixed number of sweeps: each updates the table friction of
every disk and then every contact, starting from the latest impulses.

Disks that touch without overlapping form a planar graph (a coin graph), so N bodies
have at most 3 N - 6 contacts. Among many bodies only this number of closest pairs is
solved, which contains all contacts: the cost grows with the number of bodies instead of
its square.
"""

from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from jax import lax
from jaxtyping import Array, Int

from sainet.engines.planar.contact import (
    Bodies,
    Contact,
    ContactImpulse,
    Properties,
    Side,
    TableImpulse,
    Twist,
    find_contact,
    solve_contact,
    solve_table,
)

# Of up to five disks and the pusher. Pairs that are compiled one by one take a fraction
# of the time of indexed ones, but gradients through many compile for minutes.
MOST_PAIRS = 15
_Carry = tuple[Any, Any, Any]  # twists, table impulses and contact impulses


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

    def sweep(_: Array, carry: _Carry) -> _Carry:
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


class _Pairs(NamedTuple):
    first: Int[Array, "pair *batch"]
    second: Int[Array, "pair *batch"]


class _Stacked(NamedTuple):
    """Properties with one axis over the bodies, for indexing by pairs."""

    radius: Array
    inverse_mass: Array
    inverse_inertia: Array
    arm: Array  # disks only


def contact_budget(body_count: int) -> int:
    """Return the largest number of contacts between bodies, the pusher included."""
    # Two bodies have one contact, although the formula gives zero.
    return min(len(every_pair(body_count)), max(3 * body_count - 6, 1))


def solve_close_pairs(
    bodies: Bodies, properties: Properties, limits: tuple[Array, ...], step: Step
) -> tuple[Twist, ...]:
    """Return the bodies' velocities, as `solve_all_pairs` does."""
    stacked = _Stacked(
        radius=_stack(properties.radius),
        inverse_mass=_stack(properties.inverse_mass),
        inverse_inertia=_stack(properties.inverse_inertia),
        arm=_stack(properties.arm),
    )
    pairs, contacts = _closest(bodies, properties, stacked, step)
    limit = jnp.stack(limits)
    disks = slice(0, len(limits))

    def sweep(_: Array, carry: _Carry) -> _Carry:
        twist, table, touching = carry
        table, moved = solve_table(
            table,
            Twist(*(part[disks] for part in twist)),
            limit=limit,
            arm=stacked.arm,
            inverse_mass=stacked.inverse_mass[disks],
            inverse_inertia=stacked.inverse_inertia[disks],
        )
        twist = Twist(
            *(whole.at[disks].set(p) for whole, p in zip(twist, moved, strict=True))
        )
        twist, touching = lax.scan(_solve_pair, twist, (pairs, contacts, touching))
        return twist, table, touching

    zero, none = jnp.zeros_like(limit), jnp.zeros(pairs.first.shape, limit.dtype)
    start = (
        Twist(*map(_stack, (bodies.velocity_x, bodies.velocity_y, bodies.spin))),
        TableImpulse(zero, zero, zero),
        ContactImpulse(none, none),
    )
    twist = lax.fori_loop(0, step.sweeps, sweep, start)[0]
    return tuple(Twist(*(part[i] for part in twist)) for i in range(len(bodies.x)))


def _stack(values: tuple[Array, ...]) -> Array:
    return jnp.stack(jnp.broadcast_arrays(*values))


def _closest(
    bodies: Bodies, properties: Properties, stacked: _Stacked, step: Step
) -> tuple[_Pairs, Contact]:
    x, y, radius = _stack(bodies.x), _stack(bodies.y), stacked.radius
    count = len(bodies.x)
    first, second = np.array(every_pair(count)).T
    distance = jnp.hypot(x[second] - x[first], y[second] - y[first])
    gap = lax.stop_gradient(distance - radius[first] - radius[second])
    nearest = jnp.argsort(gap, axis=0)[: contact_budget(count)]
    # In the order of all pairs: with few sweeps the order matters, and rounding decides
    # which of two touching pairs is closer.
    nearest = jnp.sort(nearest, axis=0)
    pairs = _Pairs(jnp.asarray(first)[nearest], jnp.asarray(second)[nearest])
    contact = find_contact(
        (
            _pick(x, pairs.second) - _pick(x, pairs.first),
            _pick(y, pairs.second) - _pick(y, pairs.first),
        ),
        _sides(stacked, pairs.first),
        _sides(stacked, pairs.second),
        friction=jnp.where(
            pairs.first == count - 1,
            jnp.broadcast_to(properties.pusher_friction, nearest.shape),
            jnp.broadcast_to(properties.disk_friction, nearest.shape),
        ),
        time_step=step.time_step,
        recovery=step.recovery,
    )
    return pairs, contact


def _sides(stacked: _Stacked, index: Array) -> Side:
    return Side(
        radius=_pick(stacked.radius, index),
        inverse_mass=_pick(stacked.inverse_mass, index),
        inverse_inertia=_pick(stacked.inverse_inertia, index),
    )


def _pick(values: Array, index: Array) -> Array:
    return jnp.take_along_axis(values, index, axis=0)


def _put(values: Array, index: Array, new: Array) -> Array:
    return jnp.put_along_axis(values, index[None], new[None], axis=0, inplace=False)


def _solve_pair(
    twist: Twist, pair: tuple[_Pairs, Contact, ContactImpulse]
) -> tuple[Twist, ContactImpulse]:
    (first, second), contact, impulse = pair
    one = Twist(*(_pick(part, first[None])[0] for part in twist))
    other = Twist(*(_pick(part, second[None])[0] for part in twist))
    impulse, one, other = solve_contact(contact, impulse, one, other)
    twist = Twist(*(_put(w, first, n) for w, n in zip(twist, one, strict=True)))
    twist = Twist(*(_put(w, second, n) for w, n in zip(twist, other, strict=True)))
    return twist, impulse
