"""Push the second disk to a goal with the SAIN that ships, in a simulated world."""

import jax.numpy as jnp
import numpy as np

import sainet as sn
from sainet.control.episode import ControlStep, run_episode
from sainet.engines import make_engine
from sainet.planning import make_planner
from sainet.robots.simulated import SimulatedRobot
from sainet.tasks.push_to_goal import PushToGoal
from sainet.worlds.noise import NoiseConfig
from sainet.worlds.setups import RobotSetup
from sainet.worlds.world import SimulatedWorld

# The world: a rough table, noise, and a friction that is no input of the model.
scene = sn.Scene.disks(mass=[0.9, 1.0], radius=[0.054, 0.059], table_friction=0.12)
state = scene.in_a_row()
engine, rng = make_engine("planar"), np.random.default_rng(0)
world = SimulatedWorld(engine, RobotSetup(), NoiseConfig(), rng)
robot = SimulatedRobot(world, scene, state)

# The goal: 100 mm ahead of disk 2, 20 mm to the side.
task = PushToGoal(state.position[1] + jnp.array([0.10, 0.02]))


def tell(step: ControlStep) -> None:
    """Say what was planned and how far the goal was."""
    push = np.rad2deg(
        [step.plan.pushes[0].contact_angle, step.plan.pushes[0].direction]
    )
    away = 1000 * task.distance(step.observed)
    print(f"{away:6.1f} mm to go: contact {push[0]:+.0f}, direction {push[1]:+.0f} deg")


planner = make_planner("greedy")
episode = run_episode(robot, planner, "sain", task, scene, on_step=tell)
print(f"{episode.reason} after {len(episode.steps)} pushes")
