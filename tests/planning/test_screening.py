"""Screening of pushes by the engine, against the search by the model alone."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from planning.scenes import goal_ahead, scene, touching
from sainet.engines import make_engine
from sainet.engines.base import AbstractEngine
from sainet.models.dynamics import AbstractDynamics, PhysicsDynamics
from sainet.models.library import load_model
from sainet.planning.levels import Level, Problem
from sainet.planning.screening import FEWEST, Screen
from sainet.planning.tree import TreePlanner
from sainet.scenes.geometry import rotate
from sainet.scenes.pushes import PushGrid, push_axis
from sainet.scenes.state import Trajectory

SCENE, STATE = scene(), touching()
GRID = PushGrid(contact_bins=5, direction_bins=4)  # 20 pushes, 400 sequences
TASKS = [goal_ahead(0.17, 0.6), goal_ahead(0.009, 0.3)]  # the second is near
# Added to every end, along and across the axis of the disks: m.
OFF = jnp.array([[0.002, -0.001], [-0.001, 0.003]])


class Shifted(AbstractDynamics):
    """An engine whose ends are shifted, equally in the frame of every push axis."""

    engine: AbstractEngine
    seen: list[int]

    @property
    def engine_alone(self) -> PhysicsDynamics:
        return PhysicsDynamics(self.engine)

    def begin(self, scene, state):
        return state

    def advance(self, scene, carry, controls, simulated=None):
        self.seen.append(len(carry.angle))
        states = self.engine.rollout(scene, carry, controls).states
        axis = push_axis(carry)[:, None]
        off = rotate(jnp.broadcast_to(OFF, carry.position.shape), axis)
        moved = states.position + off[:, None]
        found = Trajectory(eqx.tree_at(lambda x: x.position, states, moved))
        return found.final, found


def shifted() -> Shifted:
    return Shifted(make_engine("planar"), [])


def screen(task, model=None, **settings):
    problem = Problem(model or shifted(), task, SCENE, STATE, GRID, **settings)
    first = problem.first_level()
    return problem, first, Screen(problem, first)


def test_equal_residuals_are_screened_without_error():
    problem, first, screened = screen(TASKS[0])
    rows = np.arange(20)
    found, whole = screened.grow(first, rows), first.grow(rows, problem)
    assert (found.evaluated, len(found.actions)) == (400, FEWEST)
    best = whole.cheapest(FEWEST)
    np.testing.assert_allclose(
        np.sort(found.cost), np.sort(whole.cost[best]), rtol=0, atol=2e-5
    )
    assert set(map(tuple, found.actions[:60])) <= set(map(tuple, whole.actions[best]))


@pytest.mark.parametrize(
    ("name", "task"), [("sain", TASKS[0]), ("sain-any", TASKS[1])], ids=["far", "near"]
)
def test_shipped_networks_select_the_sequence_of_the_search_without(name, task):
    model = load_model(name).dynamics
    one, two = (
        TreePlanner(actions=GRID, is_screened=on).plan(model, task, SCENE, STATE)
        for on in (True, False)
    )
    assert one.evaluated == two.evaluated
    assert one.cost == pytest.approx(two.cost, rel=1e-4)
    assert len(one.pushes) == len(two.pushes)
    for push, other in zip(one.pushes, two.pushes, strict=True):
        assert jax.tree.all(jax.tree.map(lambda x, y: x == y, push, other))


def test_the_model_predicts_only_what_is_promising():
    model = shifted()
    TreePlanner(actions=GRID).plan(model, TASKS[0], SCENE, STATE)
    assert sum(model.seen) <= 2 * (20 + FEWEST)  # traced once for each device


def test_sequences_that_begin_with_an_infeasible_push_are_screened_out():
    _, first, screened = screen(TASKS[0])
    blocked = np.arange(20) < 15
    cost = np.where(blocked, np.inf, first.cost)
    narrow = Level(first.outcomes._replace(cost=cost), first.actions)
    found = screened.grow(narrow, np.arange(20))
    assert not blocked[found.actions[:, 0]].any()


def test_pushes_from_inside_a_disk_are_screened_out():
    wide = PushGrid(contact_bins=10, direction_bins=2, contact_range=np.pi)
    problem = Problem(shifted(), TASKS[0], SCENE, STATE, wide)
    first = problem.first_level()
    assert not np.isfinite(first.cost).all()
    assert np.isfinite(Screen(problem, first).grow(first, np.arange(20)).cost).all()


def test_a_residual_that_is_not_finite_does_not_spread():
    problem, first, _ = screen(TASKS[0])
    place = np.array(first.outcomes.state.position)
    place[3] = np.nan
    lost = eqx.tree_at(lambda x: x.position, first.outcomes.state, place)
    broken = Level(first.outcomes._replace(state=lost), first.actions)
    found = Screen(problem, broken).grow(first, np.arange(20))
    assert np.isfinite(found.cost).all()


@pytest.mark.parametrize("settings", [{"expected": True}, {}])
def test_a_screen_that_may_not_select_grows_everything(settings):
    problem, first, screened = screen(TASKS[0], **settings)
    if not settings:
        screened = Screen(problem, first, is_on=False)
    found = screened.grow(first, np.arange(20))
    assert (len(found.actions), found.screened_out) == (400, 0)


def test_engines_and_networks_without_an_engine_are_not_screened():
    assert load_model("physics").dynamics.engine_alone is None
    assert load_model("in").dynamics.engine_alone is None
    inside = load_model("sain").dynamics.engine_alone
    assert isinstance(inside, PhysicsDynamics)
