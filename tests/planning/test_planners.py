"""Planners against a naive search, and against input that cannot be planned from."""

import itertools
from dataclasses import replace
from functools import lru_cache, partial

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from models.samples import quick_dynamics
from planning.scenes import FEW, RADIUS, goal_ahead, scene, single, touching
from sainet.engines import make_engine
from sainet.models.dynamics import PhysicsDynamics
from sainet.models.library import load_model
from sainet.planning import PLANNERS, make_planner
from sainet.planning import tree as tree_module
from sainet.planning.checks import may_lack_room
from sainet.planning.greedy import GreedyPlanner
from sainet.planning.levels import (
    Level,
    Problem,
    choose,
    judge,
    predicted_ends,
    roll_pushes,
)
from sainet.planning.tree import TreePlanner
from sainet.runs.errors import (
    BadCheckpoint,
    BadInput,
    BadScene,
    BadSetting,
    Diverged,
    UnknownName,
)
from sainet.scenes.pushes import PushGrid, settled_steps
from sainet.scenes.scene import Scene
from sainet.scenes.state import at_rest
from sainet.tasks.push_to_goal import PushToGoal

SCENE, STATE = scene(), touching()
PHYSICS = PhysicsDynamics(make_engine("planar"))
FAR, NEAR = goal_ahead(0.17, 0.6), goal_ahead(0.009, 0.3, tolerance=0.02)
every_planner = pytest.mark.parametrize("name", PLANNERS)


@eqx.filter_jit
def end_of(push, state):
    batch = jax.tree.map(lambda x: x[None], (SCENE, state, push))
    end = roll_pushes(PHYSICS, *batch, 80).final
    return jax.tree.map(
        lambda x: x[0], at_rest(end.position, end.angle, end.pusher_position)
    )


@lru_cache
def naive_ends(length):
    """Every sequence of so many of the few pushes and where it ends, one by one."""
    grid, ends = FEW.pushes(), {(): STATE}
    for sequence in itertools.product(range(6), repeat=length):
        for stop in range(1, length + 1):
            if sequence[:stop] not in ends:
                push = jax.tree.map(lambda x, i=sequence[stop - 1]: x[i], grid)
                ends[sequence[:stop]] = end_of(push, ends[sequence[: stop - 1]])
    return ends


def best_of(task, length):
    """The rule in words: the fewest pushes that solve it, else the least cost."""
    ends = {s: e for s, e in naive_ends(length).items() if s}
    for count in range(1, length + 1):
        solved = [
            (float(task.distance(end)), sequence)
            for sequence, end in ends.items()
            if len(sequence) == count and task.is_solved(SCENE, end)
        ]
        if solved:
            return min(solved)[1]
    return min((float(task.cost(end)), sequence) for sequence, end in ends.items())[1]


def indices(plan):
    grid = FEW.pushes()
    return tuple(
        int(
            np.argmin(
                np.abs(grid.contact_angle - p.contact_angle)
                + np.abs(grid.direction - p.direction)
            )
        )
        for p in plan.pushes
    )


@pytest.mark.parametrize("angle", [0.25, 0.6, -0.9])
def test_the_tree_equals_a_naive_search(angle):
    task = goal_ahead(0.17, angle)
    plan = TreePlanner(actions=FEW).plan(PHYSICS, task, SCENE, STATE)
    assert indices(plan) == best_of(task, 2)
    assert plan.evaluated == 6 + 36
    assert plan.is_complete
    # The path is that of the pushes, up to the end that the search predicts.
    end = single(plan.path[-1, :, :2])
    assert plan.path.shape == (160, 2, 3)
    assert float(jnp.linalg.norm(end[1] - task.goal)) == pytest.approx(
        plan.distance, abs=2e-5
    )


def test_near_the_goal_the_best_sequences_get_a_third_push():
    planner = TreePlanner(actions=FEW, beam=36)
    plan = planner.plan(PHYSICS, NEAR, SCENE, STATE)
    assert plan.evaluated == 6 + 36 + 216
    narrow = TreePlanner(actions=FEW, beam=4)
    assert narrow.plan(PHYSICS, NEAR, SCENE, STATE).evaluated == 6 + 36 + 24


def problem(task):
    return Problem(PHYSICS, task, SCENE, STATE, FEW)


@every_planner
def test_one_sufficient_push_is_the_plan(name):
    push = jax.tree.map(lambda x: x[20], PushGrid().pushes())
    goal = end_of(push, STATE).position[1]
    task = eqx.tree_at(lambda t: t.goal, goal_ahead(0.1), goal)
    plan = make_planner(name).plan(PHYSICS, task, SCENE, STATE)
    assert len(plan.pushes) == 1
    assert plan.distance <= 0.1 * 0.059
    assert plan.evaluated >= 72


@every_planner
def test_the_grid_is_that_of_the_paper(name):
    pushes = make_planner(name).actions.pushes()
    assert pushes.length.shape == (72,)
    assert float(jnp.abs(pushes.contact_angle).max()) <= np.pi / 3
    assert float(jnp.abs(pushes.direction).max()) <= np.pi / 6


@every_planner
def test_equal_decisions_give_equal_plans(name):
    one, two = (make_planner(name).plan(PHYSICS, FAR, SCENE, STATE) for _ in range(2))
    np.testing.assert_array_equal(one.path, two.path)
    assert one.cost == two.cost


def naive_greedy(task, same, most):
    """The greedy search in words; returns the plan and all predicted sequences."""
    ends, seen, queue = naive_ends(2), [STATE], []
    cost = {s: float(task.cost(end)) for s, end in ends.items()}
    seen_sequences, grown = [], ()
    for expansion in range(most + 1):
        last = [s for s in ends if s and s[:-1] == grown]
        seen_sequences += last
        for sequence in sorted(last, key=cost.__getitem__):
            moved = [ends[sequence].position - state.position for state in seen]
            if min(np.linalg.norm(x, axis=-1).max() for x in moved) >= same:
                seen.append(ends[sequence])
                queue.append(sequence)
        solved = [s for s in last if task.is_solved(SCENE, ends[s])]
        if solved:
            return min(solved, key=lambda s: task.distance(ends[s])), seen_sequences
        if expansion < most and queue:
            grown = min(queue, key=cost.__getitem__)
            queue.remove(grown)
            if len(grown) == 2:
                return grown, seen_sequences
    return min(seen_sequences, key=cost.__getitem__), seen_sequences


# Goals are far away, or where one push or two pushes in turn bring disk 2.
@pytest.mark.parametrize(
    ("sequence", "same", "most"),
    [(None, 1e-3, 12), (None, 8e-3, 12), (None, 4e-3, 1)]
    + [((1, 1), 4e-3, 12), ((4, 5), 1e-3, 12), ((0, 5), 1e-3, 12), ((1,), 1e-3, 12)],
)
def test_the_greedy_search_equals_a_naive_one(sequence, same, most):
    task = FAR
    if sequence:
        goal = naive_ends(2)[sequence].position[1]
        task = eqx.tree_at(lambda t: t.goal, goal_ahead(0.1, tolerance=0.02), goal)
    found = GreedyPlanner(actions=FEW, same=same, expansions=most, near_horizon=2)
    found = found.search(problem(task))
    wanted, predicted = naive_greedy(task, same, most)
    assert found.actions == wanted
    assert found.evaluated == len(predicted)


def test_the_greedy_horizon_is_three_near_the_goal():
    planner = GreedyPlanner(actions=FEW, expansions=1 + 6 + 36)  # all there are
    found = planner.search(problem(NEAR))
    assert len(found.actions) == 3
    assert found.is_complete
    ends = naive_ends(3)
    assert found.cost == pytest.approx(float(NEAR.cost(ends[found.actions])), abs=1e-5)


@pytest.mark.parametrize("most", [0, 1])
def test_the_greedy_search_stops_after_its_expansions(most):
    planner = GreedyPlanner(actions=FEW, expansions=most)
    found = planner.search(problem(FAR))
    assert (found.evaluated, found.is_complete) == (6 + 6 * most, False)
    assert found.cost <= min(float(FAR.cost(e)) for e in naive_ends(1).values()) + 1e-6


def test_a_solution_in_the_last_expansion_completes_the_greedy_search():
    easy = goal_ahead(0.01, tolerance=1.0)
    found = GreedyPlanner(actions=FEW, expansions=0).search(problem(easy))
    assert (len(found.actions), found.evaluated, found.is_complete) == (1, 6, True)


def test_an_empty_queue_ends_with_the_best_sequence():
    planner = GreedyPlanner(actions=FEW, same=10.0)  # every state is the first one
    found = planner.search(problem(FAR))
    assert len(found.actions) == 1
    assert not found.is_complete


def test_a_deadline_ends_with_the_best_sequence():
    hasty = TreePlanner(actions=FEW, deadline=0.0, block=2)
    plan = hasty.plan(PHYSICS, FAR, SCENE, STATE)
    assert not plan.is_complete
    assert (len(plan.pushes), plan.evaluated) == (1, 6)
    patient = TreePlanner(actions=FEW, deadline=100.0, block=2)
    plan = patient.plan(PHYSICS, FAR, SCENE, STATE)
    assert indices(plan) == best_of(FAR, 2)
    assert plan.is_complete


def test_the_nearest_of_equally_short_solutions_is_chosen_over_all_blocks():
    of_far = problem(FAR)
    first = of_far.first_level()
    blocks = [first.grow(np.array([row]), of_far) for row in range(2)]

    def solved(level, distance):
        ends = level.outcomes._replace(
            solved=np.ones(6, bool), distance=np.full(6, distance)
        )
        return replace(level, outcomes=ends)

    far, near = solved(blocks[0], 0.002), solved(blocks[1], 0.001)
    found = choose([first, far, near])
    assert (found.actions, found.distance, found.evaluated) == ((1, 0), 0.001, 18)
    assert len(choose([solved(first, 0.003), far, near]).actions) == 1


def test_a_deadline_expands_the_best_first_pushes(
    monkeypatch,
):
    task = goal_ahead(0.17, -0.9)  # the best pushes stand last in the grid
    times = iter([0.0, 1.0, 2.0, 9.0])  # two blocks, then it is too late
    monkeypatch.setattr(tree_module.time, "perf_counter", lambda: next(times))
    grown, grow = [], Level.grow

    def spied(level, rows, expand):
        grown.extend(rows)
        return grow(level, rows, expand)

    monkeypatch.setattr(Level, "grow", spied)
    planner = TreePlanner(actions=FEW, deadline=5.0, block=2)
    found = planner.search(problem(task))
    assert (found.evaluated, found.is_complete) == (6 + 4 * 6, False)
    costs = {s[0]: float(task.cost(end)) for s, end in naive_ends(1).items() if s}
    # The first growth is that of the observed state.
    assert grown[1:] == sorted(costs, key=costs.__getitem__)[:4]


def test_outcomes_are_those_of_single_predictions():
    states = jax.tree.map(lambda *x: np.stack(x), STATE, moved())
    pushes = jax.tree.map(lambda x: x[np.array([1, 4])], jax.device_get(FEW.pushes()))
    found = judge(PHYSICS, FAR, SCENE, states, pushes)
    assert found.cost.shape == (2,)
    push = jax.tree.map(lambda x: x[4], FEW.pushes())
    wanted = end_of(push, moved())
    np.testing.assert_allclose(found.state.position[1], wanted.position, atol=1e-6)
    assert found.distance[1] == pytest.approx(float(FAR.distance(wanted)), abs=1e-6)
    assert not found.state.velocity.any()


def test_blocks_contain_every_first_push_once():
    order = np.random.default_rng(0).permutation(25)
    blocks = TreePlanner(block=12)._blocks(order)
    assert [len(block) for block in blocks] == [12, 12, 1]
    np.testing.assert_array_equal(np.concatenate(blocks), order)


@pytest.mark.parametrize(
    ("length", "speed", "time_step"),
    [(0.01, 0.05, 1 / 240), (0.01, 0.02, 1 / 240), (0.03, 0.05, 1 / 240)]
    + [(0.01, 0.05, 1 / 1000), (0.01, 0.3, 1 / 240), (0.03, 0.5, 1 / 240)],
)
def test_pushes_are_predicted_until_everything_rests(length, speed, time_step):
    slow = replace(SCENE, time_step=time_step)
    grid = replace(FEW, length=length, speed=speed)
    push = jax.tree.map(lambda x: x[:1], jax.device_get(grid.pushes()))
    given = jax.tree.map(lambda x: np.asarray(x)[None], STATE)
    found = predicted_ends(PHYSICS, slow, given, push)
    one = jax.tree.map(lambda x: x[0], push)
    path = load_model("physics-true").predict(slow, STATE, one).final
    np.testing.assert_allclose(found.position[0], path.position, atol=2e-6)
    plan = GreedyPlanner(actions=grid).plan(PHYSICS, FAR, slow, STATE)
    assert len(plan.path) % settled_steps(push, time_step) == 0
    end = single(plan.path[-1, 1, :2])
    away = float(jnp.linalg.norm(end - FAR.goal))
    assert away == pytest.approx(plan.distance, abs=2e-5)


def test_the_papers_pushes_take_48_steps_and_32_to_rest():
    assert settled_steps(PushGrid().pushes(), SCENE.time_step) == 80
    none = jax.tree.map(lambda x: x[:0], PushGrid().pushes())
    assert settled_steps(none, SCENE.time_step) == 32
    with pytest.raises(BadScene, match="push: speed is 0"):
        settled_steps(PushGrid(speed=0.0).pushes(), SCENE.time_step)


def moved():
    return eqx.tree_at(lambda s: s.position, STATE, STATE.position + 0.03)


def behind(contact_angle):
    """The two disks, and a third one where that contact angle has its pusher."""
    way = 0.5 + np.pi + contact_angle
    place = STATE.position[0] + 2 * RADIUS[0] * single([np.cos(way), np.sin(way)])
    position = jnp.concatenate([STATE.position, place[None]])
    chain = eqx.tree_at(
        lambda s: (s.mass, s.radius),
        SCENE,
        (single([0.9, 1.0, 1.0]), single([*RADIUS, RADIUS[0]])),
    )
    return chain, at_rest(position, jnp.zeros(3), single([0, 0]))


def test_pushes_inside_a_disk_and_their_sequences_are_excluded():
    grid = jax.device_get(FEW.pushes())
    chain, state = behind(grid.contact_angle.max())
    blocked = grid.contact_angle == grid.contact_angle.max()
    easy = goal_ahead(0.17, 0.6, tolerance=9.0)  # every end solves it
    of_chain = Problem(PHYSICS, easy, chain, state, FEW)
    first = of_chain.first_level()
    np.testing.assert_array_equal(np.isinf(first.cost), blocked)
    np.testing.assert_array_equal(first.outcomes.solved, ~blocked)
    second = first.grow(np.arange(6), of_chain)
    lost = blocked[second.actions].any(axis=1)
    assert not np.isfinite(second.cost[lost]).any()
    assert not second.outcomes.solved[lost].any()
    assert np.isfinite(second.cost).any()


def test_no_pusher_starts_inside_disk_2_where_the_grid_surrounds_disk_1():
    wide = PushGrid(contact_bins=9, direction_bins=1, contact_range=np.pi)
    first = Problem(PHYSICS, FAR, SCENE, STATE, wide).first_level()
    assert not may_lack_room(SCENE, FEW.pushes())
    angle = np.abs(jax.device_get(wide.pushes().contact_angle))
    free = np.isfinite(first.cost)
    assert free[angle < np.pi / 2].all()
    assert not free[angle > 3].any()
    assert 5 < free.sum() < 9


def test_a_plan_for_a_row_costs_its_distance_and_its_steering():
    """The planner measures the steering with the engine that it plans with."""
    disks = Scene.disks([1.0] * 3, [0.055] * 3)
    state = disks.in_a_row()
    task = PushToGoal(single([0.35, 0.06]), 2)
    plan = GreedyPlanner(actions=FEW, horizon=1).plan(PHYSICS, task, disks, state)
    seen = task.seen_from(partial(predicted_ends, PHYSICS, disks), disks, state, FEW)
    end = single(plan.path[-1, :, :2])
    effort = float(seen.steering.cost(end, task.goal - end[2]))
    assert effort > 0
    assert plan.cost == pytest.approx(plan.distance + effort, rel=1e-3)


@every_planner
def test_no_plan_has_a_pusher_inside_a_disk(name):
    planner = eqx.tree_at(lambda p: p.actions, make_planner(name), FEW)
    for angle in (-0.6, 0.6):
        task = goal_ahead(0.17, angle)
        side = planner.plan(PHYSICS, task, SCENE, STATE).pushes[0].contact_angle
        plan = planner.plan(PHYSICS, task, *behind(side))
        assert plan.pushes[0].contact_angle != side


@every_planner
@pytest.mark.parametrize("field", ["position", "angle"])
def test_an_observation_with_nan_is_refused(name, field):
    bad = eqx.tree_at(
        lambda s: getattr(s, field), STATE, getattr(STATE, field).at[0].set(jnp.nan)
    )
    with pytest.raises(BadScene, match=f"observation: {field}"):
        make_planner(name).plan(PHYSICS, FAR, SCENE, bad)


@every_planner
def test_overlapping_disks_are_refused(name):
    planner = eqx.tree_at(lambda p: p.actions, make_planner(name), FEW)
    with pytest.raises(BadScene, match="overlap by 8.0 mm"):
        planner.plan(PHYSICS, FAR, SCENE, touching(-0.008))
    assert planner.plan(PHYSICS, FAR, SCENE, touching(-0.0005)).warnings == ()


@pytest.mark.parametrize("bodies", [(3, 2), (1, 2), (2, 3)])
def test_an_observation_of_another_number_of_disks_is_refused(bodies):
    disks, seen = (Scene.disks([1.0] * count, 0.055) for count in bodies)
    with pytest.raises(BadScene, match=rf"angles have the shape \[{bodies[1]}\]"):
        make_planner("tree").plan(PHYSICS, FAR, disks, seen.in_a_row())


def test_a_batch_of_observations_is_refused():
    batch = jax.tree.map(lambda x: x[None], (SCENE, STATE))
    for given in ((SCENE, batch[1]), (batch[0], STATE), batch):
        with pytest.raises(BadScene, match="give one scene"):
            make_planner("tree").plan(PHYSICS, FAR, *given)


@pytest.mark.parametrize("goal", [[0.2, 0.0, 0.1], [0.2], 0.2, [[0.2, 0.0]]])
def test_a_goal_that_is_no_point_of_the_table_is_refused(goal):
    with pytest.raises(BadScene, match="task: goal has the shape"):
        make_planner("tree").plan(PHYSICS, PushToGoal(goal), SCENE, STATE)


@every_planner
def test_programs_of_double_precision_find_the_same_plan(name):
    planner = eqx.tree_at(lambda p: p.actions, make_planner(name), FEW)
    usual = planner.plan(PHYSICS, FAR, SCENE, STATE)
    with jax.enable_x64(True):
        for kind in (jnp.float32, jnp.float64):
            seen = jax.tree.map(lambda x, kind=kind: x.astype(kind), STATE)
            plan = planner.plan(PHYSICS, FAR, SCENE, seen)
            assert np.allclose(plan.path, usual.path, atol=1e-6)
            assert plan.evaluated == usual.evaluated


@every_planner
def test_a_model_without_finite_predictions_is_refused(name):
    network = quick_dynamics("in", "robot")
    lost = jax.tree.map(lambda x: x * jnp.nan if eqx.is_array(x) else x, network)
    planner = eqx.tree_at(lambda p: p.actions, make_planner(name), FEW)
    with pytest.raises(Diverged, match="is both feasible and"):
        planner.plan(lost, FAR, SCENE, STATE)


def doubtful(dynamics, state=None, actions=FEW):
    planner = eqx.tree_at(lambda p: p.actions, make_planner("tree"), actions)
    return planner.plan(dynamics, FAR, SCENE, state or touching()).warnings


def test_a_plan_warns_outside_the_training_range():
    network = quick_dynamics("in", "robot")
    assert doubtful(network) == ()
    (warning,) = doubtful(network, touching(0.02))
    assert "disks that touch" in warning
    assert doubtful(PHYSICS, touching(0.02)) == ()  # an engine was not trained
    wide = replace(FEW, contact_range=6 * np.pi / 7, length=0.02)
    found = doubtful(network, actions=wide)
    assert any("length" in warning for warning in found)
    assert any("contact angle" in warning for warning in found)


def test_a_network_for_other_pushes_is_refused():
    with pytest.raises(BadCheckpoint, match="for direct-force pushes"):
        doubtful(quick_dynamics("in", "direct-force"))
    slow = replace(SCENE, time_step=0.01)
    with pytest.raises(BadCheckpoint, match=r"step of 0.00416\d+ s, the scene 0.01"):
        make_planner("tree").plan(quick_dynamics("in", "robot"), FAR, slow, STATE)


def test_planners_by_name():
    assert make_planner("tree", deadline=0.5).deadline == 0.5
    with pytest.raises(UnknownName, match="greedy"):
        make_planner("cem")
    with pytest.raises(BadInput, match="`deadline`"):
        make_planner("greedy", deadline=1.0)


@pytest.mark.parametrize(
    ("make", "name", "value"),
    [(PushGrid, "contact_bins", bad) for bad in (0, -1)]
    + [(PushGrid, "direction_bins", 0), (TreePlanner, "beam", 0)]
    + [(TreePlanner, "block", 0), (TreePlanner, "deadline", float("nan"))]
    + [(GreedyPlanner, "horizon", 0), (GreedyPlanner, "near_horizon", -1)],
)
def test_impossible_settings_of_planners_are_refused_by_their_names(make, name, value):
    with pytest.raises(BadSetting, match=f"^`{name}` is {value}; it must be "):
        make(**{name: value})
