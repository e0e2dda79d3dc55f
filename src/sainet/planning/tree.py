"""The full tree: every sequence of two pushes, in two fused calls."""

import time

import equinox as eqx
import jax
import numpy as np

from sainet.models.dynamics import AbstractDynamics
from sainet.planning.base import AbstractPlanner, Found
from sainet.planning.levels import Expand, Level, choose, flatten
from sainet.planning.outcomes import Outcomes, every_push
from sainet.scenes.pushes import PushGrid
from sainet.scenes.scene import Scene
from sainet.scenes.state import State
from sainet.tasks.base import AbstractTask

_NEAR = 0.010  # m, distance below which third pushes are predicted (as in the paper)


class TreePlanner(AbstractPlanner):
    """Search over all sequences of two pushes.

    The shortest sequence that solves the task wins; without a solution, the sequence of
    least cost. Near the goal, the best sequences of two are extended by a third push.
    """

    actions: PushGrid = PushGrid()
    beam: int = eqx.field(static=True, default=12)  # sequences that get a third push
    deadline: float | None = eqx.field(static=True, default=None)  # s
    block: int = eqx.field(static=True, default=12)  # first pushes per deadline check

    def search(
        self, dynamics: AbstractDynamics, task: AbstractTask, scene: Scene, state: State
    ) -> Found:
        """Return the best sequence of one, two or, near the goal, three pushes."""
        late, pushes = self._clock(), jax.device_get(self.actions.pushes())

        def expand(states: State) -> Outcomes:
            return every_push(dynamics, task, scene, states, pushes)

        root = jax.tree.map(lambda x: np.asarray(x)[None], state)
        levels = [flatten(expand(root), np.zeros((1, 0), int))]
        # Expand the most promising first pushes first: a deadline may end the search.
        order = levels[0].cheapest(len(levels[0].actions))
        blocks = [order] if self.deadline is None else self._blocks(order)
        for block in blocks:
            if late():
                return choose(levels, is_complete=False)
            levels.append(levels[0].grow(block, expand))
        if float(task.distance(state)) < _NEAR:
            if late():
                return choose(levels, is_complete=False)
            levels.append(self._third(levels[1:], expand))
        return choose(levels)

    def _clock(self):  # noqa: ANN202
        """Return a function that returns whether the deadline has passed."""
        end = time.perf_counter() + (self.deadline or np.inf)
        return lambda: time.perf_counter() > end

    def _blocks(self, order: np.ndarray) -> list[np.ndarray]:
        count = -(-len(order) // self.block)
        return np.split(np.resize(order, count * self.block), count)

    def _third(self, levels: list[Level], expand: Expand) -> Level:
        """Return the best sequences of two, extended by every third push."""
        joined = Level(
            jax.tree.map(lambda *x: np.concatenate(x), *(v.outcomes for v in levels)),
            np.concatenate([level.actions for level in levels]),
        )
        return joined.grow(joined.cheapest(self.beam), expand)
