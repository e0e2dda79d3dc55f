"""Screening: the engine inside a model selects the pushes that the model predicts.

An engine takes a fraction of the time of the network around it. It predicts every
sequence, and the residual that the model found for the same push from the first state
is added, as a control variate. The model then predicts the most promising sequences.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from sainet.engines.devices import over_devices
from sainet.models.dynamics import AbstractDynamics
from sainet.planning.levels import (
    AT_ONCE,
    Level,
    Problem,
    Shared,
    batch_of,
    ends_of,
    outcomes_of,
)
from sainet.scenes.geometry import rotate
from sainet.scenes.pushes import Push, push_axis
from sainet.scenes.scene import Scene
from sainet.scenes.state import State, at_rest

SHARE = 12  # of so many sequences the model predicts one
FEWEST = 72  # sequences that the model predicts in any case


class Residual(NamedTuple):
    """What a model adds to the ends of its engine, in the frame of the push axis."""

    position: Float[Array, "push body 2"]  # m
    angle: Float[Array, "push body"]  # rad


@dataclass(frozen=True)
class Screen:
    """Grows sequences for a problem, as far as its engine finds them promising."""

    problem: Problem
    first: Level  # every sequence of one push, predicted by the model
    is_on: bool = True

    def grow(self, level: Level, rows: Int[np.ndarray, " row"]) -> Level:
        """Return the most promising sequences that extend some by one push.

        All of them where the screen is off, where there are few, where the model has no
        engine that is faster, and where it weighs its uncertainty.
        """
        actions = len(self.problem.pushes.length)
        count = len(rows) * actions
        kept = max(FEWEST, -(-count // SHARE))
        engine = self.problem.dynamics.engine_alone if self.is_on else None
        if engine is None or self.problem.expected or count <= kept:
            return level.grow(rows, self.problem)
        parents, each = np.repeat(rows, actions), np.tile(np.arange(actions), len(rows))
        cost = self._cost(engine, level.after(parents), each)
        cost = np.where(np.isfinite(cost + level.cost[parents]), cost, np.inf)
        best = np.argsort(cost, kind="stable")[:kept]
        grown = level.extend(parents[best], each[best], self.problem)
        return replace(grown, screened_out=count - kept)

    def _cost(
        self, engine: AbstractDynamics, states: State, actions: Int[np.ndarray, " push"]
    ) -> Float[np.ndarray, " push"]:
        """Return the cost of pushes by the engine and the residuals of first pushes."""
        problem = self.problem
        added = jax.tree.map(lambda x: x[actions], self._residual)
        shared = problem.shared(engine)
        rows = states, problem.at(actions), added
        return np.asarray(over_devices(_corrected_cost, shared, *rows, most=AT_ONCE))

    @cached_property
    def _residual(self) -> Residual:
        """The residual of every push from the first state."""
        problem, pushes = self.problem, self.first.actions[:, 0]
        start = jax.tree.map(
            lambda x: np.repeat(np.asarray(x)[None], len(pushes), axis=0), problem.state
        )
        shared = problem.dynamics.engine_alone, problem.scene, problem.steps
        rows = start, problem.at(pushes), self.first.outcomes.state
        return jax.device_get(over_devices(_residual_of, shared, *rows))


def _residual_of(
    shared: tuple[AbstractDynamics, Scene, int],
    states: State,
    pushes: Push,
    found: State,
) -> Residual:
    engine, scene, steps = shared
    scenes = batch_of(scene, states.angle.shape[0])
    ends = ends_of(engine, scenes, states, pushes, steps)
    back = -push_axis(states)[:, None]
    moved = rotate(found.position - ends.position, back), found.angle - ends.angle
    return Residual(*map(jnp.nan_to_num, moved))  # unknown where a model diverged


def _corrected_cost(
    shared: Shared, states: State, pushes: Push, added: Residual
) -> Float[Array, " push"]:
    engine, _, scene, steps, _ = shared
    scenes = batch_of(scene, states.angle.shape[0])
    ends = ends_of(engine, scenes, states, pushes, steps)
    moved = rotate(added.position, push_axis(states)[:, None])
    ends = at_rest(
        ends.position + moved, ends.angle + added.angle, ends.pusher_position
    )
    return outcomes_of(shared, scenes, states, pushes, ends).cost
