"""Push the second disk to a goal with the shipped SAIN, in a simulated world."""

import jax.numpy as jnp
import numpy as np

import sainet as sn
from sainet.control.episode import ControlStep

# The world: a rough table, noise, and a friction that is not an input of the model.
scene = sn.Scene.disks(mass=[0.9, 1.0], radius=[0.054, 0.059], table_friction=0.12)
state = scene.in_a_row()
engine, rng = sn.make_engine("planar"), np.random.default_rng(0)
world = sn.SimulatedWorld(engine, sn.RobotSetup(), sn.NoiseConfig(), rng)
robot = sn.SimulatedRobot(world, scene, state)

# The goal: 100 mm ahead of disk 2, 20 mm to the side.
task = sn.PushToGoal(state.position[1] + jnp.array([0.10, 0.02]))


def report(step: ControlStep) -> None:
    """Print the planned push and the distance to the goal before it."""
    push = np.rad2deg(
        [step.plan.pushes[0].contact_angle, step.plan.pushes[0].direction]
    )
    away = 1000 * task.distance(step.observed)
    print(f"{away:6.1f} mm to go: contact {push[0]:+.0f}, direction {push[1]:+.0f} deg")


planner = sn.make_planner("greedy")
episode = sn.run_episode(robot, planner, "sain", task, scene, on_step=report)
print(f"{episode.reason} after {len(episode.steps)} pushes")
