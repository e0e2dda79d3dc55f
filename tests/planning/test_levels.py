"""Levels of a search, made up by hand: order, selection, and room for the pusher."""

from dataclasses import replace

import jax.numpy as jnp
import numpy as np
import pytest

from models.samples import quick_dynamics
from planning.scenes import FEW, RADIUS, goal_ahead, scene, single, touching
from sainet.engines import make_engine
from sainet.models.dynamics import PhysicsDynamics
from sainet.planning.checks import check_observation, doubts, has_room, may_lack_room
from sainet.planning.greedy import _Queue
from sainet.planning.levels import Level, Outcomes, Problem, choose
from sainet.runs.errors import BadScene, Diverged
from sainet.scenes.pushes import Push, place_pusher
from sainet.scenes.scene import Scene
from sainet.scenes.state import at_rest

START = np.zeros((1, 2))


def level_of(cost, distance=None, solved=None, place=None, length=1):
    """Sequences whose disk ends at `place` (m); each is a place of its own if None."""
    count = len(cost)
    place = np.arange(1.0, count + 1) if place is None else np.asarray(place)
    position = np.stack([place, np.zeros(count)], axis=-1)[:, None]
    state = at_rest(single(position), jnp.zeros((count, 1)), jnp.zeros((count, 2)))
    distance = np.array(cost if distance is None else distance, np.float32)
    solved = np.zeros(count, bool) if solved is None else np.asarray(solved)
    ends = Outcomes(state, np.array(cost, np.float32), distance, solved)
    actions = np.arange(count)[:, None] + np.zeros((count, length), int)
    return Level(ends, actions)


def test_sequences_of_equal_cost_keep_the_order_of_the_grid():
    level = level_of(np.repeat([2.0, 1.0], 72))
    wanted = np.r_[72:144, 0:72]
    np.testing.assert_array_equal(level.cheapest(144), wanted)
    np.testing.assert_array_equal(level.cheapest(3), [72, 73, 74])


def test_costs_that_are_not_finite_are_the_highest():
    level = level_of([np.nan, 3.0, np.inf, 1.0])
    np.testing.assert_array_equal(level.cost, [np.inf, 3.0, np.inf, 1.0])
    np.testing.assert_array_equal(level.cheapest(2), [3, 1])
    with pytest.raises(Diverged, match="none of the 2 candidate pushes"):
        choose([level_of([np.nan, np.inf])])


def test_of_solutions_the_distance_decides_and_not_the_cost():
    """Row 1 is nearest to the goal without solving the task, row 3 costs least."""
    level = level_of(
        cost=[4.0, 3.0, 2.0, 1.0],
        distance=[3e-3, 1e-3, 2e-3, 4e-3],
        solved=[True, False, True, True],
    )
    found = choose([level, level_of([0.1])], is_complete=False)
    assert found.actions == (2,)
    assert (found.cost, found.distance) == pytest.approx((2.0, 2e-3))
    assert (found.evaluated, found.is_complete) == (5, False)


def test_fewer_pushes_are_preferred_to_a_nearer_end():
    one, two = (
        level_of([1.0], distance=[away], solved=[True], length=length)
        for length, away in ((1, 4e-3), (2, 1e-3))
    )
    assert len(choose([two, one]).actions) == 1
    nearer = level_of([9.0], distance=[5e-4], solved=[True], length=2)
    assert choose([two, nearer]).distance == pytest.approx(5e-4)


def test_without_a_solution_the_least_cost_of_all_levels_is_chosen():
    levels = [level_of([3.0, 2.0]), level_of([5.0, 1.0, 4.0]), level_of([2.5])]
    found = choose([replace(levels[0], screened_out=7), *levels[1:]])
    assert (found.actions, found.cost, found.evaluated) == ((1,), 1.0, 13)


def test_the_goal_is_near_within_10_mm():
    for millimetres, wanted in ((9.9, True), (10.1, False)):
        task = goal_ahead(millimetres / 1000)
        physics = PhysicsDynamics(make_engine("planar"))
        assert Problem(physics, task, scene(), touching(), FEW).is_near is wanted


def popped(queue):
    found = []
    while queue:
        found.append(queue.pop()[1])
    return found


def test_the_queue_is_ordered_by_cost_and_then_by_arrival():
    queue = _Queue(0.1, START)
    queue.add(level_of([2.0, np.inf, 1.0, 2.0, np.nan, 1.0]))
    assert popped(queue) == [2, 5, 0, 3]


def test_the_queue_takes_of_equal_states_the_one_of_least_cost():
    """The start counts as queued; states are compared with all that were queued."""
    queue = _Queue(0.1, START)
    queue.add(level_of([3.0, 2.0, 1.0, 1.5], place=[0.5, 0.55, 0.05, 0.2]))
    assert popped(queue) == [3, 1]
    queue.add(level_of([1.0, 2.0], place=[0.47, 0.35]))
    assert popped(queue) == [1]


def test_states_are_equal_only_if_all_disks_are():
    queue = _Queue(0.1, np.zeros((2, 2)))
    state = at_rest(
        single([[[0.0, 0.0], [0.2, 0.0]]]), jnp.zeros((1, 2)), jnp.zeros((1, 2))
    )
    ends = level_of([1.0]).outcomes._replace(state=state)
    queue.add(Level(ends, np.zeros((1, 1), int)))
    assert queue


def test_the_pusher_has_room_where_no_further_disk_overlaps_it():
    """The oracle is a loop over all disks but the pushed one."""
    rng = np.random.default_rng(0)
    count, radius = 60, [*RADIUS, 0.05]
    disks = Scene.disks([1.0] * 3, radius)
    scenes = Scene(*(jnp.stack([x] * count) for x in _fields(disks)))
    place = np.zeros((count, 3, 2))
    place[:, 1:] = rng.uniform(-0.12, 0.12, (count, 2, 2))
    states = at_rest(single(place), jnp.zeros((count, 3)), jnp.zeros((count, 2)))
    pushes = Push(single(rng.uniform(-np.pi, np.pi, count)))
    start = np.asarray(place_pusher(scenes, states, pushes))
    wanted = [
        all(
            np.linalg.norm(start[push] - place[push, disk]) >= radius[disk] + 0.0048
            for disk in (1, 2)
        )
        for push in range(count)
    ]
    found = np.asarray(has_room(scenes, states, pushes))
    np.testing.assert_array_equal(found, wanted)
    assert 0.2 < found.mean() < 0.8


def _fields(disks):
    names = ("mass", "radius", "table_friction", "disk_friction", "pusher_friction")
    return [getattr(disks, name) for name in (*names, "pusher_radius")]


@pytest.mark.parametrize(
    ("disks", "angles", "wanted"),
    [
        (1, [0.0, 3.0], False),
        (2, [-1.5, 1.5], False),
        (2, [-1.6, 0.0], True),
        (2, [0.0, 1.6], True),
        (3, [-0.5, 0.5], True),
    ],
)
def test_room_is_checked_where_a_disk_may_be_in_the_way(disks, angles, wanted):
    given = Scene.disks([1.0] * disks, 0.055)
    assert may_lack_room(given, Push(single(angles))) == wanted


@pytest.mark.parametrize(
    ("gap", "warns"), [(-4.0, False), (4.9, False), (5.1, True), (np.inf, False)]
)
def test_networks_are_doubted_where_disks_are_more_than_5_mm_apart(gap, warns):
    """One disk is apart from no other: its gap is infinite."""
    network = quick_dynamics("in", "robot")
    assert len([*doubts(network, gap / 1000, [])]) == warns
    assert not [*doubts(PhysicsDynamics(make_engine("planar")), gap / 1000, [])]
    long = Push(0.1, 0.1, 0.5)
    (doubt,) = doubts(network, 0.0, [Push(0.1), long])
    assert doubt.startswith("push 2: ")


def test_an_overlap_of_more_than_5_mm_cannot_be_noise():
    one = Scene.disks([1.0], 0.05)
    assert check_observation(one, one.in_a_row()) == np.inf
    gap = check_observation(scene(), touching(-0.0049))
    assert gap == pytest.approx(-0.0049, abs=1e-6)
    with pytest.raises(BadScene, match="two disks overlap by 5.1 mm"):
        check_observation(scene(), touching(-0.0051))
