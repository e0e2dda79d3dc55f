"""The Gymnasium environments: the interface, and the same trials as in control."""

import subprocess
import sys
from dataclasses import replace
from importlib.util import find_spec

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import sainet as sn
from sainet.control.config import ControlConfig
from sainet.control.gym import raster
from sainet.control.gym.actions import ContinuousActions, GridActions
from sainet.control.gym.registration import PUSH_DISKS
from sainet.control.trials import run_trials
from sainet.report import palette
from sainet.robots.simulated import SimulatedRobot
from sainet.runs.errors import BadInput, BadSetting, UnknownName
from support import require

MODULES = {"planar": "jax", "bullet": "pybullet", "lab": "mujoco"}
AHEAD = 33  # an action


def make(world="planar", **options):
    require(find_spec(MODULES[world]), f"{MODULES[world]} is not installed")
    return gymnasium.make(PUSH_DISKS, world=world, **options)


def make_many(count, **options):
    mode = "vector_entry_point"
    return gymnasium.make_vec(
        PUSH_DISKS, num_envs=count, vectorization_mode=mode, **options
    )


def assert_same(one, other):
    """Bit by bit."""
    for name, values in one.items():
        np.testing.assert_array_equal(values, other[name])


@pytest.mark.parametrize("actions", ["grid", "continuous"])
@pytest.mark.parametrize("world", MODULES)
def test_gymnasium_finds_no_fault(world, actions):
    env = make(world, actions=actions, reward="dense", render_mode="rgb_array")
    check_env(env.unwrapped)


@pytest.mark.parametrize("world", MODULES)
def test_equal_seeds_and_actions_have_equal_results(world):
    def episode(env):
        env.action_space.seed(3)
        starts = [env.reset(seed=5)[0]]
        return starts + [env.step(env.action_space.sample())[0] for _ in range(3)]

    env = make(world, actions="continuous")
    other = make(world, actions="continuous")
    one, again, new = (episode(each) for each in (env, env, other))
    for first, second, third in zip(one, again, new, strict=True):
        assert_same(first, second)
        assert_same(first, third)
    assert np.any(env.reset(seed=6)[0]["desired_goal"] != one[0]["desired_goal"])


@pytest.mark.parametrize("world", ["planar", "lab"])
def test_episodes_equal_the_trials_of_control(tmp_path, world):
    env = make(world, goals="hard", pushes=3)
    config = env.unwrapped.config.control(seed=4)
    settings = {**vars(config), "model": "physics", "trials": 2}
    records = run_trials(ControlConfig(**settings), tmp_path / "out")
    policy = sn.GreedyPlanner(sn.load_model("physics"), env.unwrapped.task)
    for number, record in enumerate(records):
        seed = {"seed": 4} if number == 0 else {}
        observation, info = env.reset(**seed)
        goal = 1000 * observation["desired_goal"]
        np.testing.assert_allclose(goal, record.goal_mm, atol=0.006)
        for step in record.steps:
            pose = 1000 * observation["observation"].reshape(2, 3)[:, :2]
            np.testing.assert_allclose(
                pose, np.array(step.observed, float)[:, :2], atol=0.006
            )
            action = policy.act(observation)
            push = env.unwrapped.task.actions.pushes(action)
            assert np.rad2deg(push.contact_angle) == pytest.approx(
                step.contact_angle_deg
            )
            assert np.rad2deg(push.direction) == pytest.approx(step.direction_deg)
            observation, _, terminated, truncated, info = env.step(action)
        assert info["is_success"] == record.solved
        assert 1000 * info["distance"] == pytest.approx(record.final_mm, rel=1e-6)
        assert truncated and not terminated


@pytest.mark.parametrize("reward", ["sparse", "dense"])
def test_rewards_are_recomputed_for_any_goals(reward):
    env = make(reward=reward)
    observation, _ = env.reset(seed=0)
    observation, found, *_, info = env.step(AHEAD)
    compute, place = env.unwrapped.compute_reward, observation["achieved_goal"]
    assert compute(place, observation["desired_goal"], info) == np.float32(found)
    goals = place + np.array([[0.0, 0.0], [0.0, 0.0052], [0.0, 0.0054], [0.3, 0.4]])
    found = compute(np.tile(place, (4, 1)), goals, [{}] * 4)
    # The stopping tolerance is 0.9 x 0.1 x 59 mm.
    wanted = {"sparse": [0, 0, -1, -1], "dense": [0, -0.0052, -0.0054, -0.5]}
    np.testing.assert_allclose(found, wanted[reward], atol=1e-6)


def test_an_episode_ends_at_the_goal():
    env = make(noise_level="none")
    start = env.reset(seed=0)[0]["achieved_goal"]
    # 10 mm ahead: one push along the axis of the disks is enough.
    env.reset(seed=0, options={"goal": start + np.float32([0.008, 0.0])})
    _, reward, terminated, truncated, info = env.step(AHEAD)
    assert (reward, terminated, truncated, info["is_success"]) == (0, True, False, True)
    with pytest.raises(gymnasium.error.ResetNeeded, match="call `reset`"):
        env.step(AHEAD)


def test_a_disk_that_is_lost_ends_the_episode(monkeypatch):
    env = make()
    before, _ = env.reset(seed=0)

    def lose(self, push):
        self.arrange(sn.at_rest(self.truth.position + 9.0, *rest(self)))
        return kept(self, push)

    def rest(robot):
        return robot.truth.angle, robot.truth.pusher_position

    kept = SimulatedRobot.push
    monkeypatch.setattr(SimulatedRobot, "push", lose)
    after, _, terminated, truncated, info = env.step(AHEAD)
    assert (terminated, truncated) == (False, True)
    assert info["trouble"] and not info["is_success"]
    assert_same(before, after)


@pytest.mark.parametrize("action", [72, -1, 1.5, "1", None, [1, 2], [[1], [2, 3]]])
def test_an_action_outside_the_grid_moves_nothing(action):
    env, other = make(), make()
    for each in (env, other):
        each.reset(seed=1)
    with pytest.raises(BadSetting, match="^`action` is .* a whole number from 0 to 71"):
        env.unwrapped.step(action)
    assert_same(env.step(AHEAD)[0], other.step(AHEAD)[0])


@pytest.mark.parametrize("action", [[1.1, 0], [np.nan, 0], [0.5], 3, ["a", "b"]])
def test_a_continuous_action_outside_the_box_is_refused(action):
    env = make(actions="continuous")
    env.reset(seed=1)
    with pytest.raises(BadSetting, match="two numbers from -1 to 1"):
        env.unwrapped.step(action)


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"goal": [3.0, 0.0]}, "not on the table; give x and y from -2 to 2 m"),
        ({"goal": [np.nan, 0.0]}, "not on the table"),
        ({"goal": "there"}, "not on the table"),
        ({"trial": -1}, "`trial` is -1"),
        ({"trial": 0.5}, "`trial` is 0.5"),
        ({"gaol": [0, 0]}, "did you mean goal"),
    ],
)
def test_bad_options_of_reset_are_named_and_lose_nothing(options, says):
    env, other = make(), make()
    for each in (env, other):
        each.reset(seed=1)
    with pytest.raises(BadInput, match=says) as caught:
        env.reset(seed=2, options=options)
    assert "\n" not in str(caught.value)
    assert_same(env.step(AHEAD)[0], other.step(AHEAD)[0])


# In another process: here, a check of types would be first.
NO_OPTIONS = f"""
import gymnasium, numpy, sainet
env = gymnasium.make({PUSH_DISKS!r}, disable_env_checker=True)
for options in (5, 0, True, "goal", ["goal"], numpy.array([0.1, 0.2]), {{5: 1}}):
    try:
        env.reset(seed=0, options=options)
    except sainet.runs.errors.BadSetting as error:
        print(error)
"""


def test_options_that_are_no_dict_are_refused():
    line = [sys.executable, "-W", "error", "-c", NO_OPTIONS]
    found = subprocess.run(line, capture_output=True, text=True, check=True).stdout
    *wrong, unknown = found.splitlines()
    assert wrong[0] == "`options` is 5; it must be None, or a dict of goal and trial."
    assert [line.split("; ")[-1] for line in wrong] == [wrong[0].split("; ")[1]] * 6
    assert unknown == "`options` is 5; it must be one of goal, trial."


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"pushes": 0}, "`pushes` is 0"),
        ({"disks": 50}, "`disks` is 50; .*2 m long"),
        ({"obstacles": 1}, "`obstacles` is 1"),
        ({"moved": 3}, "`moved` is 3"),
        ({"surface": "plywood"}, "`surface` is plywood; .* outside the world lab"),
        ({"lab": 2}, "`lab` is 2"),
    ],
)
def test_impossible_options_are_named(options, says):
    for maker in (gymnasium.make, gymnasium.make_vec):
        with pytest.raises(BadInput, match=says):
            maker(PUSH_DISKS, **options)


@pytest.mark.parametrize("maker", [gymnasium.make, gymnasium.make_vec])
def test_unknown_options_suggest_the_nearest(maker):
    with pytest.raises(BadInput, match=r"^No option named 'goal' \(did you mean goals"):
        maker(PUSH_DISKS, goal="hard")


def test_many_environments_draw_no_pictures():
    words = "`render_mode` is rgb_array; it must be None if `vectorization_mode`"
    with pytest.raises(BadSetting, match=words):
        make_many(2, render_mode="rgb_array")
    assert make_many(2, render_mode=None).num_envs == 2


def test_a_seed_that_is_refused_loses_nothing():
    env, other = make().unwrapped, make().unwrapped
    for each in (env, other):
        each.reset(seed=1)
    for seed in (-1, 2**32):
        with pytest.raises(BadSetting, match="`seed` is "):
            env.reset(seed=seed)
    assert_same(env.reset()[0], other.reset()[0])


def test_a_policy_takes_a_model_by_name_and_refuses_an_environment():
    code = f"""
import gymnasium, sainet as sn
env = gymnasium.make('{PUSH_DISKS}')
policy = sn.GreedyPlanner("physics", env.unwrapped.task)
assert policy.act(env.reset(seed=0)[0]) in env.action_space
sn.TreePlanner("physics", env)"""
    says = run(code).stderr.splitlines()[-1]
    assert says.startswith("sainet.runs.errors.BadSetting: `task` is <")
    assert says.endswith("it must be that of an environment, env.unwrapped.task.")
    with pytest.raises(UnknownName, match=r"did you mean sain\?"):
        sn.TreePlanner("sani", make().unwrapped.task)


def test_unknown_names_are_named():
    """In a process of its own, which does not check types before our checks."""
    for options, says in (
        ("world='havok'", "`world` is havok; it must be one of planar, bullet, lab"),
        ("goals='harder'", "did you mean hard?"),
    ):
        code = f"import gymnasium, sainet; gymnasium.make('{PUSH_DISKS}', {options})"
        assert says in run(code).stderr.splitlines()[-1]


def test_actions_stand_for_pushes_and_back():
    grid, box = GridActions(), ContinuousActions()
    pushes = grid.grid.pushes()
    for index in range(72):
        push = grid.pushes(index)
        assert grid.action(push) == index
        assert push.contact_angle == pushes.contact_angle[index]
        fraction = box.action(push)
        assert fraction in box.space
        again = box.pushes(fraction)
        np.testing.assert_allclose(again.contact_angle, push.contact_angle, rtol=1e-6)
        np.testing.assert_allclose(again.direction, push.direction, rtol=1e-6)
        assert (again.length, again.speed) == (push.length, push.speed)
    left = box.pushes(np.ones(2))
    assert np.rad2deg([left.contact_angle, left.direction]) == pytest.approx([60, 30])


def test_a_policy_refuses_other_observations():
    env = make()
    policy = sn.TreePlanner(sn.load_model("physics"), env.unwrapped.task)
    observation, _ = env.reset(seed=0)
    observation["observation"] = observation["observation"][:3]
    with pytest.raises(BadInput, match=r"no numbers of shape \(6,\) under 'obs"):
        policy.act(observation)
    observation, _ = env.reset(seed=0)
    del observation["desired_goal"]
    with pytest.raises(BadInput, match=r"no numbers of shape \(2,\) under 'desired"):
        policy.act(observation)


def test_models_are_given_no_true_friction():
    for world in ("planar", "lab"):
        scene = make(world).unwrapped.task.scene
        assert float(scene.table_friction) == pytest.approx(0.15)
        assert scene.friction_field is None


@pytest.mark.parametrize("disks", [{}, {"disks": 3, "moved": 2}])
def test_a_picture_has_the_disks_where_they_are(disks):
    env = make(render_mode="rgb_array", **disks)
    env.reset(seed=0)
    picture = env.render()
    assert picture.shape == (480, 480, 3) and picture.dtype == np.uint8
    running = env.unwrapped._running
    pixel = running.view.side / 480
    centres = np.asarray(running.trial.robot.truth.position)
    radius = np.asarray(running.trial.robot.scene.radius)
    colors = (raster.PUSHED, raster.MOVED, raster.OTHER)
    for disk, color in enumerate(colors[: len(centres)]):
        rgb = [int(color[i : i + 2], 16) for i in (1, 3, 5)]
        rows, columns = np.nonzero((picture == rgb).all(axis=-1))
        middle = np.array([columns.mean() - 239.5, 239.5 - rows.mean()])
        # The mark of the angle covers a part of the disk ahead of its centre.
        found = running.view.centre + pixel * middle
        np.testing.assert_allclose(found, centres[disk], atol=0.06 * radius[disk])
    assert make().unwrapped.render() is None


@pytest.mark.parametrize("unknown", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("name", ["position", "angle", "pusher_position"])
def test_a_picture_leaves_out_unknown_poses(name, unknown, monkeypatch):
    env = make(render_mode="rgb_array").unwrapped
    env.reset(seed=0)
    robot = env._running.trial.robot
    known = getattr(robot.truth, name)
    truth = replace(robot.truth, **{name: known.at[0].set(unknown)})
    before = env.render()
    monkeypatch.setattr(type(robot), "truth", truth)
    picture = env.render()
    assert not (picture == before).all()
    moved = [int(raster.MOVED[i : i + 2], 16) for i in (1, 3, 5)]
    assert (picture == moved).all(axis=-1).sum() > 1000


def test_pictures_have_the_colours_of_reports():
    for name in ("INK", "PAPER", "PUSHED", "MOVED", "OTHER", "TARGET"):
        assert getattr(raster, name) == getattr(palette, name)


@pytest.fixture(scope="module")
def many():
    return make_many(5)


@pytest.mark.parametrize("disks", [{}, {"disks": 4, "obstacles": 1, "moved": 2}])
def test_many_environments_equal_single_ones(disks):
    """Without noise, the batched tables and the robot move the disks alike."""
    options = {"goals": "hard", "pushes": 2, "noise_level": "none", **disks}
    many = make_many(5, **options)
    actions = np.random.default_rng(0).integers(72, size=(3, 5))
    found = [(many.reset(seed=7)[0], None, None, None, None)]
    found += [many.step(each) for each in actions]
    for index in (0, 4):
        env = make(**options)
        assert_same(env.reset(seed=7 + index)[0], row(found[0][0], index))
        for action, step in zip(actions[:2, index], found[1:3], strict=True):
            observation, *scalars, info = env.step(int(action))
            for name, values in row(step[0], index).items():
                np.testing.assert_allclose(observation[name], values, atol=2e-5)
            assert scalars == [values[index] for values in step[1:4]]
            assert info["is_success"] == step[4]["is_success"][index]
            away = step[4]["distance"][index]
            assert info["distance"] == pytest.approx(away, abs=2e-5)
        # The next trial begins at the next step, whatever the action.
        assert_same(env.reset()[0], row(found[3][0], index))
        assert [values[index] for values in found[3][1:4]] == [0, False, False]


def test_many_environments_judge_success_by_the_true_radius():
    """As single ones do, whatever properties models are given."""
    options = {"given_properties": "assumed", "noise_level": "none"}
    env, many = make(**options).unwrapped, make_many(1, **options).unwrapped
    place = env.reset(seed=0)[0]["achieved_goal"]
    many.reset(seed=0)
    # The true radius is 59 mm: 5.9 mm is a tenth.
    for away, wanted in ((0.00585, True), (0.00595, False)):
        goal = place + np.float32([0.0, away])
        many._tables.goal[0] = goal
        assert env.reset(seed=0, options={"goal": goal})[1]["is_success"] == wanted
        assert many._infos()["is_success"] == [wanted]


def test_trials_may_begin_in_the_step_that_ends_the_one_before():
    options = {"pushes": 2, "noise_level": "none"}
    later = make_many(3, **options)
    at_once = make_many(3, autoreset_mode="SameStep", **options)
    mode = gymnasium.vector.AutoresetMode.SAME_STEP
    assert at_once.metadata["autoreset_mode"] == mode
    assert_same(later.reset(seed=7)[0], at_once.reset(seed=7)[0])
    first, second, ignored = np.random.default_rng(0).integers(72, size=(3, 3))
    last, *scalars, infos = later.step(first)
    found, *same, final = at_once.step(first)
    assert_same(last, found)
    np.testing.assert_array_equal(scalars, same)
    assert "final_obs" not in final
    last, *scalars, infos = later.step(second)
    began, *same, final = at_once.step(second)
    np.testing.assert_array_equal(scalars, same)
    assert final["_final_obs"].all() and final["_final_info"].all()
    for index in range(3):
        assert_same(row(last, index), final["final_obs"][index])
    for name, values in infos.items():
        np.testing.assert_array_equal(final["final_info"][name], values)
    fresh, *_, infos = later.step(ignored)
    assert_same(fresh, began)
    np.testing.assert_array_equal(infos["distance"], final["distance"])
    # An episode that goes on has no end to show.
    at_once.reset(seed=7)
    at_once._pushes[1] = 1
    *_, final = at_once.step(first)
    assert final["_final_obs"].tolist() == [False, True, False]
    assert [each is None for each in final["final_obs"]] == [True, False, True]
    assert final["final_info"]["_distance"].tolist() == [False, True, False]


@pytest.mark.parametrize(
    "mode", ["Disabled", "", gymnasium.vector.AutoresetMode.DISABLED]
)
def test_other_autoreset_modes_are_refused(mode):
    with pytest.raises(BadSetting, match="`autoreset_mode` is .* one of NextStep"):
        make_many(2, autoreset_mode=mode)


def row(observation, index):
    return {name: values[index] for name, values in observation.items()}


def test_many_environments_are_reproducible_with_noise():
    def results():
        env = make_many(3, pushes=2, actions="continuous")
        env.action_space.seed(0)
        yield env.reset(seed=[1, 5, 9])[0]
        for _ in range(3):
            observation, *_ = env.step(env.action_space.sample())
            assert observation in env.observation_space
            yield observation

    for one, other in zip(results(), results(), strict=True):
        assert_same(one, other)


def test_many_environments_take_the_whole_numbers_of_numpy_as_seeds(many):
    wanted = many.reset(seed=3)[0]["desired_goal"]
    np.testing.assert_array_equal(
        many.reset(seed=np.int64(3))[0]["desired_goal"], wanted
    )


def test_one_environment_takes_the_whole_numbers_of_numpy_as_seeds():
    env = make()
    wanted = env.reset(seed=3)[0]["desired_goal"]
    np.testing.assert_array_equal(
        env.reset(seed=np.int64(3))[0]["desired_goal"], wanted
    )


def test_many_environments_declare_their_autoreset(many):
    mode = gymnasium.vector.AutoresetMode.NEXT_STEP
    assert many.metadata["autoreset_mode"] == mode
    assert many.single_action_space == make().action_space
    assert many.single_observation_space == make().observation_space


def test_bad_input_of_many_environments_is_named(many):
    with pytest.raises(BadSetting, match="`world` is bullet; it must be planar"):
        make_many(2, world="bullet")
    many.reset(seed=0)
    with pytest.raises(BadSetting, match="5 actions, each a whole number"):
        many.step(np.array([0, 1, 2, 3, 72]))
    with pytest.raises(BadInput, match="2 seeds; give 5"):
        many.reset(seed=[1, 2])
    with pytest.raises(BadInput, match="has none"):
        many.reset(options={"goal": [0, 0]})
    with pytest.raises(gymnasium.error.ResetNeeded):
        make_many(2).step(np.zeros(2, int))


@pytest.mark.parametrize(
    "code",
    [
        "import gymnasium, sainet",
        "import sainet, gymnasium",
    ],
)
def test_the_environment_is_registered_in_any_order_of_imports(code):
    code += f"; gymnasium.spec('{PUSH_DISKS}')"
    code += "\nimport sys; assert 'jax' not in sys.modules"
    done = run(code)
    assert done.returncode == 0, done.stderr


def test_sainet_imports_no_gymnasium_and_names_the_extra():
    code = "import sys, sainet; assert 'gymnasium' not in sys.modules\n"
    assert run(code).returncode == 0
    code += "sys.modules['gymnasium'] = None\nimport sainet.control.gym.environment"
    assert "pip install 'sainet[gym]'" in run(code).stderr.splitlines()[-1]


def run(code):
    command = [sys.executable, "-W", "error", "-c", code]
    return subprocess.run(command, capture_output=True, text=True, check=False)
