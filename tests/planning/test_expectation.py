"""Means over where disks are expected: exact for squares, larger for distances."""

import jax.numpy as jnp
import numpy as np
import pytest

from planning.scenes import goal_ahead, scene, touching
from sainet.models.correctors import CONFIDENCE, Region
from sainet.models.dynamics import PhysicsDynamics
from sainet.models.library import load_model
from sainet.planning import make_planner
from sainet.planning.expectation import mean_over
from sainet.planning.levels import Problem
from sainet.scenes.pushes import PushGrid
from sainet.scenes.state import State, at_rest

# Standard deviations of a normal distribution whose ellipse of 90 % has half axes 1.
DEVIATION = 1 / np.sqrt(-2 * np.log(1 - CONFIDENCE))
PLACES = np.array([[[0.0, 0.0], [0.1, 0.02]], [[0.01, 0.0], [0.12, 0.0]]])


def region_of(axes, heading=(0.3, -1.2)):
    axes = jnp.broadcast_to(jnp.asarray(axes, jnp.float32), (2, 2, 2))
    zeros = jnp.zeros((2, 2))
    return Region(jnp.array(heading), axes, zeros, jnp.ones((2, 2, 2)))


def ends() -> State:
    place = jnp.asarray(PLACES, jnp.float32)
    return at_rest(place, jnp.zeros((2, 2)), jnp.zeros((2, 2)))


def test_certain_ends_have_their_own_cost():
    task = goal_ahead(0.05)
    found = mean_over(region_of([0.0, 0.0]), task.cost, ends())
    assert np.allclose(found, task.cost(ends()), rtol=1e-6)


def test_squared_distances_are_exact():
    """E |p - g|^2 = |mean - g|^2 + the variances, in any orientation."""
    goal = jnp.array([0.05, 0.07])
    square = lambda s: jnp.sum((s.position[:, 1] - goal[None]) ** 2, axis=-1)  # noqa: E731
    axes = np.array([0.004, 0.001])
    found = mean_over(region_of(axes), square, ends())
    wanted = square(ends()) + np.sum((axes * DEVIATION) ** 2)
    assert np.allclose(found, wanted, rtol=1e-5)


def test_expected_distances_are_those_of_many_draws():
    task, axes = goal_ahead(0.05), np.array([0.006, 0.002])
    region = region_of(axes)
    rng = np.random.default_rng(0)
    draws = DEVIATION * axes * rng.standard_normal((20_000, 2, 2, 2))
    cosine, sine = np.cos(region.heading), np.sin(region.heading)
    turn = np.stack([[cosine, -sine], [sine, cosine]]).transpose(2, 0, 1)
    moved = PLACES + np.einsum("pij,dpbj->dpbi", turn, draws)
    goal = np.asarray(task.goal)
    sampled = np.linalg.norm(moved[:, :, 1] - goal, axis=-1).mean(axis=0)
    found = mean_over(region, task.distance, ends())
    assert np.allclose(found, sampled, rtol=5e-3)
    assert (found > task.distance(ends())).all()


class Unsure(PhysicsDynamics):
    """Physics that is unsure about pushes to one side."""

    def region(self, scene, state, controls):
        aside = controls.command[:, -1, 1] - controls.command[:, 0, 1] > 0
        size = jnp.where(aside, 0.03, 1e-6)[:, None, None]
        axes = jnp.broadcast_to(size, (*state.angle.shape, 2))
        zeros = jnp.zeros(state.angle.shape)
        heading = jnp.zeros(state.angle.shape[0])
        return Region(heading, axes, zeros, axes)


class UnsureOnHost(Unsure):
    """The same, as if its engine ran outside JAX."""

    @property
    def on_host(self):
        return True


@pytest.mark.parametrize("kind", [Unsure, UnsureOnHost])
def test_planners_avoid_pushes_that_a_model_is_unsure_about(kind):
    unsure = kind(load_model("physics-true").dynamics.engine)
    task = goal_ahead(0.05)
    headings = {}
    for expected in (False, True):
        problem = Problem(unsure, task, scene(), touching(), PushGrid(), expected)
        level = problem.first_level()
        best = problem.pushes.contact_angle + problem.pushes.direction
        headings[expected] = best[level.cheapest(12)]
    assert (headings[False] > 0).any()
    assert (headings[True] <= 0).all()


@pytest.mark.parametrize("name", ["greedy", "tree"])
def test_a_model_without_regions_plans_as_before(name):
    model, state = load_model("physics-true").dynamics, touching()
    plans = [
        make_planner(name, expected=expected).plan(
            model, goal_ahead(0.05), scene(), state
        )
        for expected in (False, True)
    ]
    assert plans[0].cost == plans[1].cost
    assert plans[0].pushes[0].contact_angle == plans[1].pushes[0].contact_angle
