"""Outcomes of sequences of pushes, and the levels that a search selects from."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple, TypeVar

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from sainet.engines.devices import over_devices
from sainet.models.dynamics import AbstractDynamics
from sainet.planning.checks import has_room, may_lack_room
from sainet.planning.expectation import mean_over
from sainet.runs.errors import Diverged
from sainet.scenes.pushes import Push, PushGrid, command_path, settled_steps
from sainet.scenes.scene import Scene
from sainet.scenes.state import State, Trajectory, at_rest
from sainet.tasks.push_to_goal import AbstractTask

AT_ONCE = 1296  # rows: intermediate arrays of more rows exceed the cache
_Result = TypeVar("_Result")
# What all pushes of a call share; each is predicted for so many steps. Last, whether a
# pusher may start inside a disk.
Shared = tuple[AbstractDynamics, AbstractTask, Scene, int, bool]


class Outcomes(NamedTuple):
    """Final states of pushes, assumed at rest, as judged by the task."""

    state: State  # everything at rest
    cost: Float[Array, "*batch"]  # m, infinite for infeasible pushes
    distance: Float[Array, "*batch"]  # m
    solved: Bool[Array, "*batch"]


def judge(
    dynamics: AbstractDynamics,
    task: AbstractTask,
    scene: Scene,
    states: State,
    pushes: Push,
    *,
    expected: bool = False,
) -> Outcomes:
    """Return the outcome of one push from each state, until all bodies rest.

    Compiled once for each number of pushes, split over all devices.

    Args:
        dynamics: model that predicts.
        task: task that judges.
        scene: one scene, without a batch axis.
        states: states at rest, ``[push]``.
        pushes: from these states, ``[push]``.
        expected: whether cost and distance are means over where the model expects the
            disks.

    Returns:
        The outcomes, ``[push]``, as NumPy arrays.
    """
    steps = settled_steps(pushes, scene.time_step)
    shared = dynamics, task, scene, steps, may_lack_room(scene, pushes)
    function = _judge_expected if expected else _judge
    return _of_pushes(function, shared, states, pushes, AT_ONCE)


def predicted_ends(
    dynamics: AbstractDynamics, scene: Scene, states: State, pushes: Push
) -> State:
    """Return where one push from each state of one scene ends, ``[push]``, at rest."""
    shared = dynamics, scene, settled_steps(pushes, scene.time_step)
    return _of_pushes(_ends, shared, states, pushes)


def _of_pushes(
    function: Callable[..., _Result],
    shared: tuple[Any, ...],
    states: State,
    pushes: Push,
    most: int | None = None,
) -> _Result:
    """Return ``function(shared, states, pushes)`` as NumPy arrays, ``[push]``."""
    if shared[0].on_host:  # the engine uses every core itself
        found = function(shared, *jax.tree.map(jnp.asarray, (states, pushes)))
    else:
        found = over_devices(function, shared, states, pushes, most=most)
    return jax.device_get(found)


def _ends(
    shared: tuple[AbstractDynamics, Scene, int], states: State, pushes: Push
) -> State:
    dynamics, scene, steps = shared
    scenes = batch_of(scene, states.angle.shape[0])
    return ends_of(dynamics, scenes, states, pushes, steps)


def roll_pushes(
    dynamics: AbstractDynamics, scene: Scene, states: State, pushes: Push, steps: int
) -> Trajectory:
    """Return the motion of one push from each state; all share one batch axis."""
    initial, controls = command_path(scene, states, pushes, steps=steps)
    carry = dynamics.begin(scene, initial)
    return dynamics.advance(scene, carry, controls)[1]


def batch_of(scene: Scene, count: int) -> Scene:
    """Return a scene as a batch of equal scenes."""
    return jax.tree.map(lambda x: jnp.broadcast_to(x, (count, *x.shape)), scene)


def _judge(shared: Shared, states: State, pushes: Push) -> Outcomes:
    dynamics, _, scene, steps, _ = shared
    scenes = batch_of(scene, states.angle.shape[0])
    ends = ends_of(dynamics, scenes, states, pushes, steps)
    return outcomes_of(shared, scenes, states, pushes, ends)


def ends_of(
    dynamics: AbstractDynamics, scenes: Scene, states: State, pushes: Push, steps: int
) -> State:
    """Return where one push from each state ends, at rest; all share one batch axis."""
    end = roll_pushes(dynamics, scenes, states, pushes, steps).final
    return at_rest(end.position, end.angle, end.pusher_position)


def outcomes_of(
    shared: Shared, scenes: Scene, states: State, pushes: Push, ends: State
) -> Outcomes:
    """Return ends of pushes as the task judges them; all share one batch axis."""
    _, task, *_, is_crowded = shared
    cost, solved = task.cost(ends), task.is_solved(scenes, ends)
    if is_crowded:
        free = has_room(scenes, states, pushes)
        cost, solved = jnp.where(free, cost, jnp.inf), solved & free
    return Outcomes(ends, cost, task.distance(ends), solved)


def _judge_expected(shared: Shared, states: State, pushes: Push) -> Outcomes:
    """Return the outcomes with the cost and the distance that are expected."""
    dynamics, task, scene, steps, _ = shared
    found = _judge(shared, states, pushes)
    scenes = batch_of(scene, states.angle.shape[0])
    commanded = command_path(scenes, states, pushes, steps=steps)
    region = dynamics.region(scenes, *commanded)
    if region is None:
        return found
    possible = jnp.isfinite(found.cost)
    return found._replace(
        cost=jnp.where(possible, mean_over(region, task.cost, found.state), jnp.inf),
        distance=mean_over(region, task.distance, found.state),
    )


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
        return jax.tree.map(lambda x: np.asarray(x, np.float32), self.grid.pushes())

    @cached_property
    def steps(self) -> int:
        """How many steps each push is predicted for."""
        return settled_steps(self.pushes, self.scene.time_step)

    def shared(self, dynamics: AbstractDynamics) -> Shared:
        """Return what all candidate pushes share that some dynamics predict."""
        crowded = may_lack_room(self.scene, self.pushes)
        return dynamics, self.task, self.scene, self.steps, crowded

    @property
    def is_near(self) -> bool:
        """Whether the goal is within 10 mm (as in the paper)."""
        return float(self.task.distance(self.state)) < _NEAR

    def at(self, actions: Int[np.ndarray, " push"]) -> Push:
        """Return some of the candidate pushes."""
        return jax.tree.map(lambda x: x[actions], self.pushes)

    def first_level(self) -> "Level":
        """Return the sequences of one push."""
        root = jax.tree.map(lambda x: np.asarray(x)[None], self.state)
        start = Outcomes(root, jnp.zeros(1), jnp.zeros(1), jnp.zeros(1, bool))
        return Level(start, np.zeros((1, 0), int)).grow(np.zeros(1, int), self)


@dataclass(frozen=True)
class Found:
    """The sequence of actions that a search selects."""

    actions: tuple[int, ...]
    cost: float
    distance: float  # m
    evaluated: int
    is_complete: bool = True


@dataclass(frozen=True)
class Level:
    """Sequences of one length, one per row, with their outcomes."""

    outcomes: Outcomes  # [sequence]
    actions: Int[np.ndarray, "sequence push"]  # indices into the grid
    screened_out: int = 0  # further sequences, which only an engine predicted

    @property
    def evaluated(self) -> int:
        """The number of predicted sequences."""
        return len(self.actions) + self.screened_out

    @property
    def cost(self) -> Float[np.ndarray, " sequence"]:
        """The cost at the end of each sequence; infinite where it is NaN."""
        return np.nan_to_num(self.outcomes.cost, nan=np.inf, posinf=np.inf)

    @property
    def miss(self) -> Float[np.ndarray, " sequence"]:
        """The distance at the end of each solution (m); infinite for the others."""
        return np.where(self.outcomes.solved, self.outcomes.distance, np.inf)

    def cheapest(self, count: int) -> Int[np.ndarray, " count"]:
        """Return the rows of least cost, in order of cost."""
        return np.argsort(self.cost, kind="stable")[:count]

    def grow(self, rows: Int[np.ndarray, " row"], problem: Problem) -> "Level":
        """Return some sequences, extended by every push."""
        count = len(problem.pushes.length)
        each = np.tile(np.arange(count), len(rows))
        return self.extend(np.repeat(rows, count), each, problem)

    def extend(
        self,
        rows: Int[np.ndarray, " push"],
        actions: Int[np.ndarray, " push"],
        problem: Problem,
    ) -> "Level":
        """Return some sequences, each extended by one push."""
        states, pushes = self.after(rows), problem.at(actions)
        given = problem.dynamics, problem.task, problem.scene, states, pushes
        found = judge(*given, expected=problem.expected)
        possible = np.isfinite(self.cost[rows])  # no push follows an infeasible push
        cost, solved = np.where(possible, found.cost, np.inf), found.solved & possible
        grown = np.concatenate([self.actions[rows], actions[:, None]], axis=1)
        return Level(found._replace(cost=cost, solved=solved), grown)

    def after(self, rows: Int[np.ndarray, " push"]) -> State:
        """Return the states at the end of some sequences."""
        return jax.tree.map(lambda x: x[rows], self.outcomes.state)

    def found(self, row: int, evaluated: int, *, is_complete: bool = True) -> Found:
        """Return one of the sequences as the result of a search."""
        return Found(
            actions=tuple(int(action) for action in self.actions[row]),
            cost=float(self.outcomes.cost[row]),
            distance=float(self.outcomes.distance[row]),
            evaluated=evaluated,
            is_complete=is_complete,
        )


def choose(levels: Sequence[Level], *, is_complete: bool = True) -> Found:
    """Return the shortest sequence that solves the task, else that of least cost.

    Of equally short ones, it is the one that ends nearest to the goal.

    Args:
        levels: of any sequence lengths.
        is_complete: whether the search ran to its end.

    Raises:
        Diverged: no cost is finite.
    """
    evaluated = sum(level.evaluated for level in levels)
    if solved := [level for level in levels if level.outcomes.solved.any()]:
        best = min(solved, key=lambda level: (level.actions.shape[1], level.miss.min()))
        nearest = int(np.argmin(best.miss))
        return best.found(nearest, evaluated, is_complete=is_complete)
    best = min(levels, key=lambda level: level.cost.min())
    if not np.isfinite(best.cost.min()):
        raise Diverged(
            f"model: none of the {evaluated} candidate pushes is both feasible and "
            "finite; check the scene and the observation, or use another model."
        )
    return best.found(int(best.cheapest(1)[0]), evaluated, is_complete=is_complete)
