"""Steering of rows, against the least-squares optimum and by the planar engine."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from sainet.engines import make_engine
from sainet.models.dynamics import PhysicsDynamics
from sainet.planning.levels import predicted_ends
from sainet.runs.errors import BadScene
from sainet.scenes.pushes import PushGrid
from sainet.scenes.scene import Scene
from sainet.scenes.state import at_rest
from sainet.tasks.push_to_goal import PushToGoal
from sainet.tasks.steering import Steering, steering_of

RADIUS, MISS = 0.055, 0.005
GRID = PushGrid()
RANGES = np.array([GRID.contact_range, GRID.direction_range])
ADVANCE = 0.010  # m


def disks(count):
    return Scene.disks([1.0] * count, [RADIUS] * count)


def row(links, start=(0.0, 0.0), heading=0.0):
    """Touching disks whose links have given angles from a heading."""
    angles = heading + np.asarray(links, float)
    ways = 2 * RADIUS * np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    place = np.asarray(start) + np.concatenate([np.zeros((1, 2)), ways.cumsum(axis=0)])
    return at_rest(place.tolist(), [0.0] * len(place), [0.0, 0.0])


class Linear:
    """Rows that move linearly in the angles of their links and of the push."""

    def __init__(self, links, seed=0):
        rng = np.random.default_rng(seed)
        self.free = np.eye(links) + 0.1 * rng.normal(size=(links, links))
        self.push = 0.1 * rng.normal(size=(links, 2))
        self.aside = 0.005 * rng.normal(size=links), 0.005 * rng.normal(size=2)

    def __call__(self, states, pushes):
        place = np.asarray(states.position, float)
        ways = np.diff(place, axis=1)
        links = np.arctan2(ways[..., 1], ways[..., 0])
        given = np.stack([pushes.contact_angle, pushes.direction], axis=-1)
        after = links @ self.free.T + given @ self.push.T
        aside = links @ self.aside[0] + given @ self.aside[1]
        moved = np.stack([np.full(len(place), ADVANCE), aside], axis=-1)
        back = 2 * RADIUS * np.stack([np.cos(after), np.sin(after)], axis=-1)
        behind = np.cumsum(back[:, ::-1], axis=1)[:, ::-1]
        last = place[:, -1:] + moved[:, None]
        position = np.concatenate([last - behind, last], axis=1)
        return at_rest(jnp.asarray(position), states.angle, states.pusher_position)

    def least(self, links, pushes):
        """The least sum of squares, as a problem of least squares in all angles."""
        count = len(links)
        bends = np.diff(np.eye(count), axis=0)
        now, by = np.asarray(links, float), np.zeros((count, 2 * pushes))
        aside, aside_by = 0.0, np.zeros(2 * pushes)
        rows, wanted = [], []
        for index in range(pushes):
            chosen = np.zeros((2, 2 * pushes))
            chosen[:, 2 * index : 2 * index + 2] = np.diag(RANGES)
            rows.append(bends @ by)
            wanted.append(-bends @ now)
            aside, aside_by = (
                aside + self.aside[0] @ now,
                aside_by + self.aside[0] @ by + self.aside[1] @ chosen,
            )
            now, by = self.free @ now, self.free @ by + self.push @ chosen
        rows += [np.eye(2 * pushes), aside_by[None] / MISS]
        wanted += [np.zeros(2 * pushes), np.array([-aside / MISS])]
        whole, target = np.concatenate(rows), np.concatenate(wanted)
        best = np.linalg.lstsq(whole, target, rcond=None)[0]
        return float(np.sum((whole @ best - target) ** 2))


def measured(roll, count, state=None):
    state = row([0.0] * (count - 1)) if state is None else state
    given = disks(len(state.angle))
    found = steering_of(roll, given, state, GRID, row=count, miss=MISS)
    assert found is not None
    return found


@pytest.mark.parametrize("count", [3, 4, 5])
def test_the_effort_is_the_least_sum_of_squares_of_all_sequences(count):
    roll = Linear(count - 1, seed=count)
    found = measured(roll, count)
    assert float(found.advance) == pytest.approx(ADVANCE, rel=1e-4)
    links = np.random.default_rng(count).uniform(-0.3, 0.3, count - 1)
    for pushes in (0, 1, 2, 7):
        effort = links @ np.asarray(found.effort[pushes], float) @ links
        wanted = roll.least(links, pushes) if pushes else 0.0
        assert effort == pytest.approx(wanted, rel=2e-3, abs=1e-6), pushes


def test_a_straight_row_before_its_goal_costs_the_distance():
    state = row([0.0, 0.0, 0.0], heading=0.7)
    way = np.array([np.cos(0.7), np.sin(0.7)])
    task = PushToGoal(state.position[3] + jnp.asarray(0.12 * way, jnp.float32), 3)
    seen = task.seen_from(Linear(3), disks(4), state, GRID)
    assert isinstance(seen.steering, Steering)
    assert float(seen.cost(state)) == pytest.approx(0.12, abs=1e-5)


@pytest.mark.parametrize("pushes", [3, 3.5, 500])
def test_the_cost_interpolates_between_numbers_of_pushes(pushes):
    found = measured(Linear(2), 3)
    links = np.array([0.2, -0.1])
    place = np.asarray(row(links, heading=np.pi - 0.05).position)
    way = np.array([np.cos(np.pi - 0.05), np.sin(np.pi - 0.05)])
    ahead = jnp.asarray(pushes * float(found.advance) * way, jnp.float32)
    low = min(int(pushes), len(found.effort) - 2)
    part = min(pushes - low, 1.0)
    effort = (1 - part) * found.effort[low] + part * found.effort[low + 1]
    wanted = GRID.length * links @ np.asarray(effort, float) @ links
    cost = found.cost(jnp.asarray(place)[None], ahead[None])
    np.testing.assert_allclose(cost, [wanted], rtol=1e-3)


ENGINE = PhysicsDynamics(make_engine("planar"))


def by_engine(state, count):
    roll = partial(predicted_ends, ENGINE, disks(len(state.angle)))
    return measured(roll, count, state)


def test_steering_depends_on_neither_place_nor_heading_nor_disks_beside_the_row():
    here = by_engine(row([0.0, 0.0]), 3)
    there = by_engine(row([0.0, 0.0], (0.3, -0.2), 2.0), 3)
    np.testing.assert_allclose(there.effort, here.effort, rtol=0.02, atol=0.02)
    state = row([0.0, 0.0])
    place = np.concatenate([state.position, [[0.11, 0.113]]])
    beside = at_rest(place.tolist(), [0.0] * 4, [0.0, 0.0])
    other = by_engine(beside, 3)
    np.testing.assert_allclose(other.effort, here.effort, rtol=0.02, atol=0.02)


def test_a_row_that_is_pushed_from_behind_is_unstable():
    """Without control its bends grow: a longer way costs more than it saves."""
    found = by_engine(row([0.0, 0.0, 0.0]), 4)
    bent = np.array([0.1, 0.0, 0.0])
    effort = np.einsum("i,kij,j->k", bent, np.asarray(found.effort, float), bent)
    assert effort[20] > 4 * effort[1]
    assert np.linalg.eigvalsh(np.asarray(found.effort[1:], float)).min() > -1e-3


def test_a_prediction_that_diverges_leaves_the_cost_of_two_disks():
    def lost(states, pushes):
        return jax.tree.map(lambda x: x * np.nan, states)

    state = row([0.0, 0.1])
    task = PushToGoal(jnp.array([0.4, 0.0]), 2)
    seen = task.seen_from(lost, disks(3), state, GRID)
    assert float(seen.cost(state)) == float(task.cost(state))


def test_a_tolerance_of_zero_still_has_a_cost():
    state = row([0.0, 0.1])
    task = PushToGoal(jnp.array([0.4, 0.0]), 2, tolerance=0.0)
    seen = task.seen_from(Linear(2), disks(3), state, GRID)
    assert np.isfinite(float(seen.cost(state)))


def test_two_disks_keep_the_heuristic_of_the_paper():
    def never(states, pushes):
        raise AssertionError

    task = PushToGoal(jnp.array([0.4, 0.0]))
    assert task.seen_from(never, disks(2), row([0.0]), GRID) is task


def test_a_target_disk_that_does_not_exist_is_named():
    task = PushToGoal(jnp.array([0.4, 0.0]), 3)
    with pytest.raises(BadScene, match="moved is 3, but the scene has 3 disks"):
        task.seen_from(Linear(2), disks(3), row([0.0, 0.0]), GRID)
