"""The task of the paper, and its goals."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from planning.scenes import RADIUS, goal_ahead, scene, touching
from sainet.runs.errors import BadScene, BadSetting
from sainet.scenes.geometry import rotate
from sainet.scenes.state import at_rest
from sainet.tasks.push_to_goal import draw_goal


def naive_cost(task, state, weight):
    first, moved = np.asarray(state.position[0]), np.asarray(state.position[task.moved])
    goal = np.asarray(task.goal)
    one, two = moved - first, goal - first
    cosine = one @ two / np.linalg.norm(one) / np.linalg.norm(two)
    return np.linalg.norm(moved - goal) + weight * (1 - cosine)


@pytest.mark.parametrize("weight", [0.0, 1.0, 3.0])
@pytest.mark.parametrize("angle", [0.0, 0.4, -2.0])
def test_the_cost_is_the_papers_heuristic(angle, weight):
    task, state = goal_ahead(0.17, angle, alignment=weight), touching()
    assert float(task.cost(state)) == pytest.approx(
        naive_cost(task, state, weight), abs=1e-5
    )
    assert float(task.distance(state)) == pytest.approx(0.17, abs=1e-6)


def test_turning_everything_changes_nothing():
    task, state = goal_ahead(0.17, 0.4), touching()
    turn = jnp.float32(1.2)
    turned = at_rest(
        rotate(state.position, turn), state.angle, rotate(state.pusher_position, turn)
    )
    other = type(task)(rotate(task.goal, turn))
    assert float(other.cost(turned)) == pytest.approx(float(task.cost(state)), abs=1e-5)


def test_solved_is_within_a_tenth_of_the_radius():
    for distance, solved in ((0.0058, True), (0.0060, False)):
        assert bool(goal_ahead(distance).is_solved(scene(), touching())) is solved
    loose = goal_ahead(0.02, tolerance=0.5)
    assert bool(loose.is_solved(scene(), touching()))


@pytest.mark.parametrize("moved", [2, -1])
def test_an_unknown_target_disk_is_refused(moved):
    task = goal_ahead(0.1, moved=moved)
    is_solved = partial(task.is_solved, scene())
    for judge in (task.distance, task.cost, is_solved):
        with pytest.raises(BadScene, match=f"moved is {moved}, .* scene has 2 disks"):
            judge(touching())


def test_a_disk_at_nan_or_infinity_is_not_at_its_goal():
    lost = jax.tree.map(lambda x: x * jnp.nan, touching())
    assert not bool(goal_ahead(0.0).is_solved(scene(), lost))
    assert not jnp.isfinite(goal_ahead(0.0).distance(lost))


@pytest.mark.parametrize("name", ["tolerance", "alignment"])
@pytest.mark.parametrize("value", [-0.1, np.nan])
def test_impossible_settings_are_refused(name, value):
    with pytest.raises(BadSetting, match=f"`{name}` is "):
        goal_ahead(0.0, **{name: value})


def test_a_disk_on_its_goal_costs_only_its_alignment():
    assert float(goal_ahead(0.0).cost(touching())) == pytest.approx(0.0, abs=1e-5)


@pytest.mark.parametrize(("kind", "low", "high"), [("easy", 0, 30), ("hard", 30, 60)])
def test_goals_follow_the_paper(kind, low, high):
    disk, axis = np.array([0.4, -0.2]), 0.7

    def draw(trial, seed=0):
        return draw_goal(kind, seed, trial, disk=disk, axis=axis, radius=RADIUS[1])

    ways = np.array([draw(trial) - disk for trial in range(200)])
    np.testing.assert_allclose(np.linalg.norm(ways, axis=1), 3 * RADIUS[1])
    angle = np.rad2deg(np.arctan2(ways[:, 1], ways[:, 0]) - axis)
    assert np.abs(angle).min() >= low
    assert np.abs(angle).max() <= high
    assert (angle > 0).mean() == pytest.approx(0.5, abs=0.12)
    np.testing.assert_array_equal(draw(7), draw(7))
    assert not np.allclose(draw(7), draw(7, seed=1))
