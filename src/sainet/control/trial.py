"""Trials: a goal and the robot of one episode."""

from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from sainet.control.config import ControlConfig
from sainet.engines.simulator import PAPER_FRICTION, PAPER_MASS, PAPER_RADIUS
from sainet.robots.base import AbstractRobot
from sainet.robots.changing import changing_robot
from sainet.robots.simulated import scene_of
from sainet.scenes.pushes import push_axis
from sainet.scenes.scene import Scene
from sainet.scenes.state import at_rest
from sainet.tasks.obstacles import Way, draw_obstacles
from sainet.tasks.push_to_goal import PushToGoal, draw_goal
from sainet.worlds.sampling import scattered

_STARTS, _WRONG = 0x57A2, 0x3A09


class Trial(NamedTuple):
    """One goal and the robot of its episode."""

    robot: AbstractRobot
    task: PushToGoal
    scene: Scene  # properties given to model and task


def make_trial(config: ControlConfig, index: int) -> Trial:
    """Return the robot and the goal of one trial, equal for all models and planners."""
    after, seed = config.new_surface_after, (config.seed, index)
    robot = changing_robot(config, after, *seed)
    true = robot.scene
    if not config.starts_in_a_row:
        rng = np.random.default_rng([_STARTS, config.seed, index])
        side = config.area_mm / 1000
        robot.arrange(scattered(rng, np.asarray(true.radius), side))
        robot.observe()
    return with_goal(config, index, robot)


def with_goal(config: ControlConfig, index: int, robot: AbstractRobot) -> Trial:
    """Return the trial of a robot, with the goal drawn from where its disks are.

    Obstacles are put beside the way to it.
    """
    true, state = robot.scene, robot.truth
    moved = config.target
    goal = draw_goal(
        config.goals,
        config.seed,
        index,
        disk=np.asarray(state.position)[moved],
        axis=float(push_axis(state)),
        radius=float(true.radius[moved]),
    )
    if config.obstacles:
        row = np.asarray(state.position)[: -config.obstacles]
        way, radius = Way(moved, goal), np.asarray(true.radius)
        others = draw_obstacles(config.seed, index, way, row, radius)
        place = state.position.at[-config.obstacles :].set(others)
        robot.arrange(at_rest(place, state.angle, state.pusher_position))
        robot.observe()
    task = PushToGoal(
        jnp.asarray(goal, jnp.float32), moved, config.tolerance, config.alignment
    )
    given = assumed_frictions(true)
    if config.given_properties == "assumed":
        given = scene_of(PAPER_MASS, PAPER_RADIUS, config.disks, PAPER_FRICTION)
    return Trial(robot, task, wrong_by(given, config, index))


def wrong_by(scene: Scene, config: ControlConfig, index: int) -> Scene:
    """Return a scene with masses and radii that are wrong by the error of a trial."""
    if not config.property_error:
        return scene
    rng = np.random.default_rng([_WRONG, config.seed, index])
    signs = rng.choice([-1.0, 1.0], (2, scene.body_count)).astype(np.float32)
    factors = 1 + np.float32(config.property_error) * signs
    wrong = scene.mass * factors[0], scene.radius * factors[1]
    return eqx.tree_at(lambda s: (s.mass, s.radius), scene, wrong)


def assumed_frictions(scene: Scene) -> Scene:
    """Return a scene with its masses and radii; models are given no true friction."""
    return Scene.disks(
        scene.mass.tolist(),
        scene.radius.tolist(),
        table_friction=PAPER_FRICTION,
        pusher_radius=float(scene.pusher_radius),
    )
