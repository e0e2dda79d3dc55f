"""The closed loop, with robots that do odd things and a planner that costs nothing."""

from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from models.samples import Glide
from planning.scenes import FEW, goal_ahead, scene, touching
from sainet.control.episode import Episode, checked, run_episode
from sainet.models.dynamics import PhysicsDynamics
from sainet.planning.base import AbstractPlanner, Plan
from sainet.planning.greedy import GreedyPlanner
from sainet.planning.levels import Found
from sainet.robots.base import AbstractRobot
from sainet.runs.errors import BadScene
from sainet.scenes.pushes import Push, PushGrid
from sainet.scenes.recording import Recording

TASK = goal_ahead(0.05)
MODEL = PhysicsDynamics(Glide())


class Lost(Glide):
    """Predicts NaN for every pose."""

    def rollout(self, scene, initial, controls):
        return jax.tree.map(
            lambda x: x * jnp.nan, super().rollout(scene, initial, controls)
        )


class Ahead(AbstractPlanner):
    """Always takes the first push, and predicts nothing."""

    actions: PushGrid = PushGrid()
    expected: bool = False

    def search(self, problem):
        return Found((0,), 0.0, 0.0, 1)

    def plan(self, dynamics, task, scene, state):
        if not np.isfinite(state.position).all():
            raise BadScene("observation: position holds NaN")
        push = jax.tree.map(lambda x: x[0], self.actions.pushes())
        return Plan((push,), lambda: np.zeros((1, 2, 3)), 0.0, 0.0, 1)


def recorded(push: Push, value: float = 0.0, trouble: str = "") -> Recording:
    """A recording of two samples in which nothing moves."""
    return Recording(
        time=np.arange(2.0),
        pose=np.full((2, 2, 3), value),
        pusher=np.zeros((2, 2)),
        commanded=push,
        trouble=trouble,
    )


class Rail(AbstractRobot):
    """Disk 2 moves straight to the goal, so much with each push."""

    def __init__(self, step=0.01, trouble="", stops_after=None):
        self.state, self.step, self.trouble = touching(), step, trouble
        self.left = stops_after

    @property
    def scene(self):
        return scene()

    @property
    def truth(self):
        return self.state

    def arrange(self, state):
        self.state = state

    def observe(self):
        return self.state

    def push(self, push):
        if self.left is not None:
            self.left -= 1
            if self.left < 0:
                raise KeyboardInterrupt
        way = TASK.goal - touching().position[1]
        way = way / jnp.linalg.norm(way) * self.step
        moved = self.state.position.at[1].add(way)
        self.state = eqx.tree_at(lambda s: s.position, self.state, moved)
        return recorded(push, trouble=self.trouble)


def run(robot, **settings):
    return run_episode(robot, Ahead(), MODEL, TASK, scene(), **settings)


def test_an_episode_ends_when_the_task_is_solved():
    steps = []
    episode = run(Rail(), on_step=steps.append)
    # 50 mm in steps of 10 mm; within 5.9 mm after the fifth.
    assert (episode.reason, len(episode.steps)) == ("solved", 5)
    assert steps == episode.steps
    observed = [step.observed for step in episode.steps] + [episode.final]
    away = [float(TASK.distance(state)) for state in observed]
    assert away == pytest.approx([0.05, 0.04, 0.03, 0.02, 0.01, 0.0], abs=1e-6)
    assert all(step.seconds >= 0 for step in episode.steps)


def test_a_reached_goal_needs_no_push():
    robot = Rail()
    robot.state = eqx.tree_at(
        lambda s: s.position, robot.state, robot.state.position.at[1].set(TASK.goal)
    )
    assert run(robot).steps == []


def test_an_episode_is_truncated_after_its_maximum_of_pushes():
    episode = run(Rail(step=0.001), pushes=7)
    assert (episode.reason, len(episode.steps)) == ("out of pushes", 7)


def test_a_robot_in_trouble_ends_the_episode():
    episode = run(Rail(step=0.0, trouble="disk 1 did not move"))
    assert episode.reason == "disk 1 did not move, 3 times in a row"
    assert len(episode.steps) == 3


class Contrary(Rail):
    """A robot that executes and reports another push than the planned push."""

    def push(self, push):
        other = eqx.tree_at(lambda p: p.direction, push, push.direction + 0.3)
        return super().push(other)


def test_an_executed_push_that_differs_from_the_planned_push_is_trouble():
    episode = run(Contrary(step=0.001))
    assert episode.reason.startswith(
        "executed push differs from the planned push: its direction"
    )
    assert len(episode.steps) == 3


def test_a_recording_with_nan_is_trouble():
    push = jax.tree.map(lambda x: x[0], PushGrid().pushes())
    blind = checked(recorded(push, np.nan), push)
    assert blind.trouble == "the recording contains NaN or infinity"
    whole = recorded(push)
    assert checked(whole, push) is whole


def test_a_recording_without_a_commanded_push_counts_as_executed_as_planned():
    push = jax.tree.map(lambda x: x[0], PushGrid().pushes())
    unknown = replace(recorded(push), commanded=None)
    assert checked(unknown, push) is unknown


def test_a_goal_out_of_reach_is_named_as_the_reason():
    episode = run(Rail(step=0.001), pushes=3)
    assert episode.reason == (
        "out of pushes: the goal was 50 mm away, and 3 x 10 mm do not reach it"
    )


def test_an_observation_with_nan_ends_the_episode():
    robot = Rail(step=float("nan"))
    episode = run(robot)
    assert episode.reason == "planning failed: observation: position holds NaN"
    assert len(episode.steps) == 1


def test_a_model_without_finite_predictions_ends_the_episode():
    planner, lost = GreedyPlanner(actions=FEW), PhysicsDynamics(Lost())
    episode = run_episode(Rail(), planner, lost, TASK, scene())
    reason = "planning failed: model: none of the 6 candidate pushes is"
    assert episode.reason.startswith(reason)
    assert episode.steps == []


def test_an_impossible_scene_is_refused():
    impossible = eqx.tree_at(lambda s: s.mass, scene(), -scene().mass)
    with pytest.raises(BadScene, match="mass"):
        run_episode(Rail(), Ahead(), MODEL, TASK, impossible)


def test_an_interruption_keeps_the_finished_pushes():
    episode = Episode()
    with pytest.raises(KeyboardInterrupt):
        run(Rail(stops_after=2), episode=episode)
    assert episode.reason == "interrupted"
    assert len(episode.steps) == 2


def test_disks_with_a_clock_of_their_own_are_no_trouble():
    push = jax.tree.map(lambda x: x[0], PushGrid().pushes())
    pose = np.full((4, 2, 3), np.nan)
    pose[::2] = 0.0
    two_clocks = replace(
        recorded(push), time=np.arange(4.0), pose=pose, pusher=np.zeros((4, 2))
    )
    assert not checked(two_clocks, push).trouble
    pose[:, 1] = np.nan  # one disk was never measured
    assert "NaN" in checked(replace(two_clocks, pose=pose), push).trouble
