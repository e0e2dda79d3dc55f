"""Trials: a goal and the simulated world of one episode."""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np

from sainet.control.config import ControlConfig
from sainet.engines import make_engine
from sainet.engines.simulator import PAPER
from sainet.robots.base import AbstractRobot
from sainet.robots.simulated import SimulatedRobot
from sainet.scenes.scene import Scene
from sainet.tasks.goals import draw_goal
from sainet.tasks.push_to_goal import PushToGoal
from sainet.worlds.config import WorldConfig, bounds
from sainet.worlds.noise import NoiseConfig, at_level
from sainet.worlds.sampling import in_a_row
from sainet.worlds.setups import RobotSetup
from sainet.worlds.world import SimulatedWorld

# True properties of the disks, which differ from the assumed properties.
MASS = (0.9, 1.0)  # kg
RADIUS = (0.054, 0.059)  # m
_WORLD = 0x3071D


class Trial(NamedTuple):
    """One goal and the robot of its episode."""

    robot: AbstractRobot
    task: PushToGoal
    scene: Scene  # properties given to model and task


def make_trial(config: ControlConfig, index: int) -> Trial:
    """Return the world and the goal of one trial, equal for all models and planners."""
    rng = np.random.default_rng([_WORLD, config.seed, index])
    friction = float(rng.uniform(*bounds(WorldConfig.table_friction)))
    true = _scene(MASS, RADIUS, config.disks, friction)
    state = in_a_row(np.asarray(true.radius))
    noise = at_level(NoiseConfig(), config.noise_level)
    world = SimulatedWorld(
        make_engine(config.world), RobotSetup(), noise, rng, np.float32
    )
    robot = SimulatedRobot(world, true, state)
    moved = config.disks - 1
    goal = draw_goal(
        config.goals,
        config.seed,
        index,
        disk=np.asarray(state.position)[moved],
        axis=0.0,
        radius=float(true.radius[moved]),
    )
    task = PushToGoal(
        jnp.asarray(goal, jnp.float32), moved, config.tolerance, config.alignment
    )
    mass, radius, friction = PAPER.mass, PAPER.radius, PAPER.table_friction
    assert mass and radius and friction  # all are assumed
    given = (mass, radius) if config.given_properties == "assumed" else (MASS, RADIUS)
    return Trial(robot, task, _scene(*given, config.disks, friction))


def _scene(
    mass: tuple[float, ...], radius: tuple[float, ...], disks: int, friction: float
) -> Scene:
    """Return a scene; disks beyond the second have the mean of both values."""

    def each(values: tuple[float, ...]) -> tuple[float, ...]:
        mean = sum(values) / len(values)
        return (*values, *[mean] * disks)[:disks]

    return Scene.disks(each(mass), each(radius), table_friction=friction)
