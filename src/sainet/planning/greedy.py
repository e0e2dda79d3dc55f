"""The paper's greedy search (section IV-D), with a queue and a short horizon."""

from heapq import heappop, heappush
from itertools import count

import equinox as eqx
import numpy as np

from sainet.planning.base import AbstractPlanner
from sainet.planning.levels import Found, Level, Problem, choose
from sainet.scenes.pushes import PushGrid
from sainet.scenes.quantities import require_count


class GreedyPlanner(AbstractPlanner):
    """Greedy search with a queue of action sequences, ordered by the heuristic.

    Each expansion removes the sequence of least heuristic and queues its 72
    continuations, except those that end at a state queued before. If an expansion
    contains solutions, the plan is the one nearest to the goal. Otherwise the plan is
    the first full-length sequence to leave the queue. If the queue runs empty or the
    limit of expansions is reached, the plan is the sequence of least heuristic, and the
    search is incomplete.
    """

    actions: PushGrid = PushGrid()
    expected: bool = eqx.field(static=True, default=False)
    horizon: int = eqx.field(static=True, default=2)
    near_horizon: int = eqx.field(static=True, default=3)  # within 10 mm of the goal
    same: float = eqx.field(static=True, default=1e-3)  # m, below which states equal
    expansions: int = eqx.field(static=True, default=12)  # maximum, after the first

    def __check_init__(self) -> None:
        """Refuse impossible settings."""
        require_count("horizon", self.horizon)
        require_count("near_horizon", self.near_horizon)

    def search(self, problem: Problem) -> Found:
        """Return the sequence selected by the queue."""
        horizon = self.near_horizon if problem.is_near else self.horizon
        levels = [problem.first_level()]
        queue = _Queue(self.same, np.asarray(problem.state.position))
        queue.add(levels[0])
        while queue and len(levels) <= self.expansions:
            if levels[-1].outcomes.solved.any():
                return choose(levels)
            level, row = queue.pop()
            if level.actions.shape[1] == horizon:
                return level.found(row, sum(v.evaluated for v in levels))
            levels.append(level.grow(np.array([row]), problem))
            queue.add(levels[-1])
        return choose(levels, is_complete=bool(levels[-1].outcomes.solved.any()))


class _Queue:
    """A queue of sequences ordered by heuristic, with the states queued so far."""

    def __init__(self, same: float, start: np.ndarray) -> None:
        self._same, self._seen = same, start[None]  # m; [state, body, 2]
        self._heap: list[tuple[float, int, Level, int]] = []
        self._ticket = count()  # equal costs leave in order of arrival

    def __bool__(self) -> bool:
        return bool(self._heap)

    def add(self, level: Level) -> None:
        """Add the sequences of a level that end at new states."""
        for row in level.cheapest(len(level.actions)):
            place = np.asarray(level.outcomes.state.position[row])
            gaps = np.linalg.norm(self._seen - place, axis=-1).max(axis=-1)
            if np.isfinite(level.cost[row]) and gaps.min() >= self._same:
                self._seen = np.concatenate([self._seen, place[None]])
                cost = float(level.cost[row])
                heappush(self._heap, (cost, next(self._ticket), level, int(row)))

    def pop(self) -> tuple[Level, int]:
        """Remove and return the sequence of least heuristic."""
        return heappop(self._heap)[2:]
