"""Outcomes of every candidate push from every state: one batched call of a model."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from sainet.engines.devices import over_devices
from sainet.models.dynamics import AbstractDynamics
from sainet.scenes.pushes import Push, command_path, place_pusher
from sainet.scenes.scene import Scene
from sainet.scenes.shapes import pusher_gaps
from sainet.scenes.state import State, Trajectory, at_rest
from sainet.tasks.base import AbstractTask

SETTLED_STEPS = 80  # 48 of motion and 32 until everything rests

_NEVER_IN_THE_WAY = 2  # disks: disk 2 is ahead of disk 1, the pusher behind
_AT_ONCE = 1296  # rows: intermediate arrays of more rows exceed the cache


class Outcomes(NamedTuple):
    """Final states of pushes, assumed at rest, as judged by the task."""

    state: State  # everything at rest
    cost: Float[Array, "*batch"]  # m, infinite for infeasible pushes
    distance: Float[Array, "*batch"]  # m
    solved: Bool[Array, "*batch"]


def every_push(
    dynamics: AbstractDynamics,
    task: AbstractTask,
    scene: Scene,
    states: State,
    pushes: Push,
) -> Outcomes:
    """Return the outcome of every push from every state, until all bodies rest.

    Compiled once for each number of states, split over all devices.

    Args:
        dynamics: model that predicts.
        task: task that judges.
        scene: one scene, without a batch axis.
        states: states at rest, ``[state]``.
        pushes: candidate pushes, ``[push]``.

    Returns:
        The outcomes, ``[state, push]``, as NumPy arrays.
    """
    count, actions = states.angle.shape[0], pushes.length.shape[0]
    # NumPy: JAX would dispatch each of the many small operations of a search.
    rows = jax.tree.map(lambda x: np.repeat(x, actions, axis=0), states)
    each = jax.tree.map(lambda x: np.tile(x, count), pushes)
    shared = dynamics, task, scene
    if dynamics.on_host:  # the engine uses every core itself
        flat = _judge(shared, *jax.tree.map(jnp.asarray, (rows, each)))
    else:
        flat = over_devices(_judge, shared, rows, each, most=_AT_ONCE)
    flat = jax.device_get(flat)
    return jax.tree.map(lambda x: x.reshape(count, actions, *x.shape[1:]), flat)


def roll_pushes(
    dynamics: AbstractDynamics, scene: Scene, states: State, pushes: Push
) -> Trajectory:
    """Return the motion of one push from each state; all share one batch axis."""
    initial, controls = command_path(scene, states, pushes, steps=SETTLED_STEPS)
    carry = dynamics.begin(scene, initial)
    return dynamics.advance(scene, carry, controls)[1]


def batch_of(scene: Scene, count: int) -> Scene:
    """Return a scene as a batch of equal scenes."""
    return jax.tree.map(lambda x: jnp.broadcast_to(x, (count, *x.shape)), scene)


def _judge(
    shared: tuple[AbstractDynamics, AbstractTask, Scene], states: State, pushes: Push
) -> Outcomes:
    dynamics, task, scene = shared
    scenes = batch_of(scene, states.angle.shape[0])
    end = roll_pushes(dynamics, scenes, states, pushes).final
    rest = at_rest(end.position, end.angle, end.pusher_position)
    cost, solved = task.cost(rest), task.is_solved(scenes, rest)
    if scene.body_count > _NEVER_IN_THE_WAY:
        free = _has_room(scenes, states, pushes)
        cost, solved = jnp.where(free, cost, jnp.inf), solved & free
    return Outcomes(rest, cost, task.distance(rest), solved)


def _has_room(scenes: Scene, states: State, pushes: Push) -> Bool[Array, " batch"]:
    """Return whether the pusher starts outside all disks."""
    start = place_pusher(scenes, states, pushes)
    initial = at_rest(states.position, states.angle, start)
    return (pusher_gaps(scenes, initial)[..., 1:] >= 0).all(axis=-1)
