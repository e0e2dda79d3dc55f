"""Levels: sequences of one length with their outcomes, which a search selects from."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import jax
import numpy as np
from jaxtyping import Float, Int

from sainet.models.dynamics import AbstractDynamics
from sainet.planning.outcomes import Outcomes, every_push
from sainet.runs.errors import Diverged
from sainet.scenes.pushes import Push, PushGrid
from sainet.scenes.scene import Scene
from sainet.scenes.state import State
from sainet.tasks.base import AbstractTask

_NEAR = 0.010  # m, distance to the goal below which longer sequences are searched


@dataclass(frozen=True)
class Problem:
    """What a search starts from: model, task, scene, state and candidate pushes."""

    dynamics: AbstractDynamics
    task: AbstractTask
    scene: Scene  # without a batch axis
    state: State  # observed, at rest
    grid: PushGrid

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
        return every_push(self.dynamics, self.task, self.scene, states, self.pushes)

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
