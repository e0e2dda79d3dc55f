"""The full tree: every sequence of two pushes, in a few fused calls."""

import time
from collections.abc import Callable
from numbers import Real

import equinox as eqx
import jax
import numpy as np

from sainet.planning.base import AbstractPlanner
from sainet.planning.levels import Found, Level, Problem, choose
from sainet.planning.screening import Screen
from sainet.runs.errors import require
from sainet.scenes.pushes import PushGrid
from sainet.scenes.quantities import require_count


class TreePlanner(AbstractPlanner):
    """Search over all sequences of two pushes.

    The shortest sequence that solves the task wins; without a solution, the sequence of
    least cost. Near the goal, the best sequences of two are extended by a third push.
    Of a model with an engine, the engine predicts every longer sequence and the model
    the most promising twelfth; see `sainet.planning.screening`.
    """

    actions: PushGrid = PushGrid()
    expected: bool = eqx.field(static=True, default=False)
    beam: int = eqx.field(static=True, default=12)  # sequences that get a third push
    deadline: float | None = eqx.field(static=True, default=None)  # s
    is_screened: bool = eqx.field(
        static=True, default=True
    )  # False: by the model alone
    block: int = eqx.field(static=True, default=12)  # first pushes per deadline check

    def __check_init__(self) -> None:
        """Refuse impossible settings."""
        require_count("beam", self.beam)
        require_count("block", self.block)
        deadline = 0.0 if self.deadline is None else self.deadline
        good = isinstance(deadline, Real) and float(deadline) >= 0
        require(good, "deadline", "a number of seconds", deadline)

    def search(self, problem: Problem) -> Found:
        """Return the best sequence of one, two or, near the goal, three pushes."""
        late, levels = self._clock(), [problem.first_level()]
        screen = Screen(problem, levels[0], is_on=self.is_screened)
        # Expand the most promising first pushes first: a deadline may end the search.
        order = levels[0].cheapest(len(levels[0].actions))
        blocks = [order] if self.deadline is None else self._blocks(order)
        for block in blocks:
            if late():
                return choose(levels, is_complete=False)
            levels.append(screen.grow(levels[0], block))
        if problem.is_near:
            if late():
                return choose(levels, is_complete=False)
            levels.append(self._third(levels[1:], screen))
        return choose(levels)

    def _clock(self) -> Callable[[], bool]:
        """Return a function that returns whether the deadline has passed."""
        end = time.perf_counter() + (np.inf if self.deadline is None else self.deadline)
        return lambda: time.perf_counter() > end

    def _blocks(self, order: np.ndarray) -> list[np.ndarray]:
        return np.split(order, range(self.block, len(order), self.block))

    def _third(self, levels: list[Level], screen: Screen) -> Level:
        """Return the best sequences of two, extended by every third push."""
        joined = Level(
            jax.tree.map(lambda *x: np.concatenate(x), *(v.outcomes for v in levels)),
            np.concatenate([level.actions for level in levels]),
        )
        return screen.grow(joined, joined.cheapest(self.beam))
