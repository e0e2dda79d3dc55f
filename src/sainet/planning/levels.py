"""Outcomes of sequences of pushes, and the levels that a search selects from."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from sainet.engines.devices import over_devices
from sainet.models.dynamics import AbstractDynamics
from sainet.planning.expectation import mean_over
from sainet.runs.errors import Diverged
from sainet.scenes.pushes import Push, PushGrid, command_path, place_pusher
from sainet.scenes.scene import Scene, pusher_gaps
from sainet.scenes.state import State, Trajectory, at_rest
from sainet.tasks.push_to_goal import AbstractTask

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
    *,
    expected: bool = False,
) -> Outcomes:
    """Return the outcome of every push from every state, until all bodies rest.

    Compiled once for each number of states, split over all devices.

    Args:
        dynamics: model that predicts.
        task: task that judges.
        scene: one scene, without a batch axis.
        states: states at rest, ``[state]``.
        pushes: candidate pushes, ``[push]``.
        expected: whether cost and distance are means over where the model expects the
            disks.

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
        judge = _judge_expected if expected else _judge
        flat = over_devices(judge, shared, rows, each, most=_AT_ONCE)
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


def _judge_expected(
    shared: tuple[AbstractDynamics, AbstractTask, Scene], states: State, pushes: Push
) -> Outcomes:
    """Return the outcomes with the cost and the distance that are expected."""
    dynamics, task, scene = shared
    found = _judge(shared, states, pushes)
    scenes = batch_of(scene, states.angle.shape[0])
    region = dynamics.region(
        scenes, *command_path(scenes, states, pushes, steps=SETTLED_STEPS)
    )
    if region is None:
        return found
    possible = jnp.isfinite(found.cost)
    return found._replace(
        cost=jnp.where(possible, mean_over(region, task.cost, found.state), jnp.inf),
        distance=mean_over(region, task.distance, found.state),
    )


def _has_room(scenes: Scene, states: State, pushes: Push) -> Bool[Array, " batch"]:
    """Return whether the pusher starts outside all disks."""
    start = place_pusher(scenes, states, pushes)
    initial = at_rest(states.position, states.angle, start)
    return (pusher_gaps(scenes, initial)[..., 1:] >= 0).all(axis=-1)


_NEAR = 0.010  # m, distance to the goal below which longer sequences are searched


@dataclass(frozen=True)
class Problem:
    """What a search starts from: model, task, scene, state and candidate pushes."""

    dynamics: AbstractDynamics
    task: AbstractTask
    scene: Scene  # without a batch axis
    state: State  # observed, at rest
    grid: PushGrid
    expected: bool = False  # judge by means over where the model expects the disks

    @cached_property
    def pushes(self) -> Push:
        """The candidate pushes, on the host."""
        return jax.device_get(self.grid.pushes())

    @property
    def is_near(self) -> bool:
        """Whether the goal is within 10 mm (as in the paper)."""
        return float(self.task.distance(self.state)) < _NEAR

    def expand(self, states: State) -> Outcomes:
        """Return the outcomes of every push from every state."""
        return every_push(
            *(self.dynamics, self.task, self.scene, states, self.pushes),
            expected=self.expected,
        )

    def first_level(self) -> "Level":
        """Return the sequences of one push."""
        root = jax.tree.map(lambda x: np.asarray(x)[None], self.state)
        return flatten(self.expand(root), np.zeros((1, 0), int))


@dataclass(frozen=True)
class Found:
    """The sequence of actions that a search selects."""

    actions: tuple[int, ...]
    cost: float
    distance: float  # m
    looked_at: int
    is_complete: bool = True


@dataclass(frozen=True)
class Level:
    """Sequences of one length, one per row, with their outcomes."""

    outcomes: Outcomes  # [sequence]
    actions: Int[np.ndarray, "sequence push"]  # indices into the grid

    @property
    def cost(self) -> Float[np.ndarray, " sequence"]:
        """The cost at the end of each sequence; infinite where it is NaN."""
        return np.nan_to_num(self.outcomes.cost, nan=np.inf, posinf=np.inf)

    def cheapest(self, count: int) -> Int[np.ndarray, " count"]:
        """Return the rows of least cost, in order of cost."""
        return np.argsort(self.cost, kind="stable")[:count]

    def grow(self, rows: Int[np.ndarray, " row"], problem: Problem) -> "Level":
        """Return some sequences, extended by every push."""
        states = jax.tree.map(lambda x: x[rows], self.outcomes.state)
        found, possible = problem.expand(states), np.isfinite(self.cost[rows])[:, None]
        # No push follows an infeasible push.
        cost, solved = np.where(possible, found.cost, np.inf), found.solved & possible
        found = found._replace(cost=cost, solved=solved)
        return flatten(found, self.actions[rows])

    def found(self, row: int, looked_at: int, *, is_complete: bool = True) -> Found:
        """Return one of the sequences as the result of a search."""
        return Found(
            actions=tuple(int(action) for action in self.actions[row]),
            cost=float(self.outcomes.cost[row]),
            distance=float(self.outcomes.distance[row]),
            looked_at=looked_at,
            is_complete=is_complete,
        )


def flatten(outcomes: Outcomes, parents: Int[np.ndarray, "state push"]) -> Level:
    """Return outcomes ``[state, push]`` as sequences, one per row."""
    states, pushes = outcomes.cost.shape
    last = np.tile(np.arange(pushes), states)[:, None]
    actions = np.concatenate([np.repeat(parents, pushes, axis=0), last], axis=1)
    flat = jax.tree.map(lambda x: x.reshape(-1, *x.shape[2:]), outcomes)
    return Level(flat, actions)


def choose(levels: Sequence[Level], *, is_complete: bool = True) -> Found:
    """Return the shortest sequence that solves the task, else that of least cost.

    Args:
        levels: in order of sequence length.
        is_complete: whether the search ran to its end.

    Raises:
        Diverged: no cost is finite.
    """
    looked_at = sum(len(level.actions) for level in levels)
    for level in levels:
        solved = level.outcomes.solved
        if solved.any():
            distance = np.where(solved, level.outcomes.distance, np.inf)
            return level.found(
                int(np.argmin(distance)), looked_at, is_complete=is_complete
            )
    best = min(levels, key=lambda level: level.cost.min())
    if not np.isfinite(best.cost.min()):
        raise Diverged(
            f"model: none of the {looked_at} candidate pushes is both feasible and "
            "finite; check the scene and the observation, or use another model."
        )
    return best.found(int(best.cheapest(1)[0]), looked_at, is_complete=is_complete)
