"""The paper's search (section IV-D): greedy, with a queue and a short horizon."""

from dataclasses import dataclass, field
from heapq import heappop, heappush
from itertools import count

import equinox as eqx
import jax
import numpy as np

from sainet.models.dynamics import AbstractDynamics
from sainet.planning.base import AbstractPlanner, Found
from sainet.planning.levels import Expand, Level, choose, flatten
from sainet.planning.outcomes import Outcomes, every_push
from sainet.pushes import PushGrid
from sainet.scene import Scene, State
from sainet.tasks.base import AbstractTask

_NEAR = 0.010  # m


class GreedyPlanner(AbstractPlanner):
    """A queue of action sequences, ordered by the heuristic.

    The sequence of least heuristic is taken out and its 72 continuations are predicted.
    The one that ends nearest to the goal goes into the queue, and the sequence itself
    goes back: should it come out again, the next nearest follows. States that the queue
    had already are left out. The first sequence of the whole horizon that comes out is
    the plan; so is any continuation that solves the task.
    """

    actions: PushGrid = PushGrid()
    horizon: int = eqx.field(static=True, default=2)
    near_horizon: int = eqx.field(static=True, default=3)  # within 10 mm of the goal
    same: float = eqx.field(static=True, default=1e-3)  # m, between equal states
    expansions: int = eqx.field(static=True, default=12)  # at most

    def search(
        self, dynamics: AbstractDynamics, task: AbstractTask, scene: Scene, state: State
    ) -> Found:
        """Return the first sequence of the horizon's length that the queue gives."""
        pushes = jax.device_get(self.actions.pushes())

        def expand(states: State) -> Outcomes:
            return every_push(dynamics, task, scene, states, pushes)

        near = float(task.distance(state)) < _NEAR
        horizon = self.near_horizon if near else self.horizon
        queue, levels = _Queue(self.same), []
        queue.add(_Node((), state), float(task.cost(state)))
        while queue:
            cost, node = queue.pop()
            if len(node.actions) == horizon:
                return node.found(cost, 72 * len(levels))
            if node.level is None:
                if len(levels) == self.expansions:
                    break
                levels.append(node.expand(expand))
                if levels[-1].outcomes.solved.any():
                    return choose(levels)
            queue.add_nearest_child(node, cost)
        return choose(levels, is_complete=False)


@dataclass
class _Node:
    """A sequence of actions, where it ends, and what may follow it."""

    actions: tuple[int, ...]
    state: State
    distance: float = float("inf")  # m
    level: Level | None = None  # its continuations
    waiting: list[int] = field(default_factory=list)  # of them, the nearest last

    def expand(self, expand: Expand) -> Level:
        """Predict every continuation and return them."""
        alone = jax.tree.map(lambda x: x[None], self.state)
        parent = np.array([self.actions], int).reshape(1, -1)
        self.level = flatten(expand(alone), parent)
        distance = np.nan_to_num(self.level.outcomes.distance, nan=np.inf)
        nearest = np.argsort(distance, kind="stable")
        self.waiting = [int(row) for row in nearest[::-1]]
        return self.level

    def child(self, row: int) -> "_Node":
        assert self.level is not None
        outcomes = self.level.outcomes
        state = jax.tree.map(lambda x: x[row], outcomes.state)
        return _Node((*self.actions, row), state, float(outcomes.distance[row]))

    def found(self, cost: float, looked_at: int) -> Found:
        return Found(self.actions, cost, self.distance, looked_at)


@dataclass
class _Queue:
    """Sequences by heuristic; knows every state that it had."""

    same: float  # m
    _heap: list[tuple[float, int, _Node]] = field(default_factory=list)
    _seen: list[np.ndarray] = field(default_factory=list)
    _ticket: count = field(default_factory=count)  # of equal costs, first come

    def __bool__(self) -> bool:
        return bool(self._heap)

    def add(self, node: _Node, cost: float) -> None:
        self._seen.append(np.asarray(node.state.position))
        heappush(self._heap, (cost, next(self._ticket), node))

    def pop(self) -> tuple[float, _Node]:
        cost, _, node = heappop(self._heap)
        return cost, node

    def add_nearest_child(self, node: _Node, cost: float) -> None:
        """Add the nearest continuation that is new, and the node for the others."""
        assert node.level is not None
        while node.waiting:
            row = node.waiting.pop()
            child_cost = float(node.level.cost[row])
            child = node.child(row)
            if np.isfinite(child_cost) and not self._had(child.state):
                self.add(child, child_cost)
                heappush(self._heap, (cost, next(self._ticket), node))
                return

    def _had(self, state: State) -> bool:
        gaps = np.asarray(self._seen) - state.position
        return bool((np.linalg.norm(gaps, axis=-1).max(axis=-1) < self.same).any())
