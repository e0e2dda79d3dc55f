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

_NEAR = 0.010  # m, from where on a third push is looked at (the paper's 10 mm)


class TreePlanner(AbstractPlanner):
    """Looks at every push, and from where each ends at every push again.

    A sequence that solves the task with fewer pushes wins; among others the least
    cost. Near the goal, the best sequences of two are looked at with a third push.
    """

    actions: PushGrid = PushGrid()
    beam: int = eqx.field(static=True, default=12)  # sequences that get a third push
    deadline: float | None = eqx.field(static=True, default=None)  # s
    block: int = eqx.field(static=True, default=12)  # first pushes between two looks

    def search(
        self, dynamics: AbstractDynamics, task: AbstractTask, scene: Scene, state: State
    ) -> Found:
        """Return the best sequence of one, two or, near the goal, three pushes."""
        late, pushes = self._clock(), jax.device_get(self.actions.pushes())

        def expand(states: State) -> Outcomes:
            return every_push(dynamics, task, scene, states, pushes)

        root = jax.tree.map(lambda x: np.asarray(x)[None], state)
        levels = [flatten(expand(root), np.zeros((1, 0), int))]
        # The most promising first pushes come first: a deadline may cut the rest.
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
        """Return a function that says whether the deadline has passed."""
        end = time.perf_counter() + (self.deadline or np.inf)
        return lambda: time.perf_counter() > end

    def _blocks(self, order: np.ndarray) -> list[np.ndarray]:
        count = -(-len(order) // self.block)
        return np.split(np.resize(order, count * self.block), count)

    def _third(self, levels: list[Level], expand: Expand) -> Level:
        """Return what a third push makes of the best sequences of two."""
        joined = Level(
            jax.tree.map(lambda *x: np.concatenate(x), *(v.outcomes for v in levels)),
            np.concatenate([level.actions for level in levels]),
        )
        return joined.grow(joined.cheapest(self.beam), expand)
