"""Compare a model of your own with SAIN, and plan with it: a function on arrays."""

import jax.numpy as jnp
import numpy as np

import sainet as sn
from sainet.tasks.push_to_goal import PushToGoal


def predict(
    scene: sn.Scene, initial: sn.State, controls: sn.PathControls
) -> np.ndarray:
    """Carry disk 1 with the pusher; return poses [push, time, body, 3] (m, m, rad)."""
    moved = controls.position - initial.pusher_position[:, None]
    poses = np.zeros((*moved.shape[:2], initial.body_count, 3))
    poses[..., :2] = initial.position[:, None]
    poses[:, :, 0, :2] += moved
    return poses


carried = sn.from_function(predict, name="carried")
pushes = sn.generate(sn.GenerateConfig(pushes=20, chunk_size=20, seed=1))
table = sn.evaluate({"physics": "physics", "carried": carried, "sain": "sain"}, pushes)
print(table)
scene = sn.Scene.disks(mass=[0.9, 1.0], radius=[0.054, 0.059])
task, planner = PushToGoal(jnp.array([0.2, 0.05])), sn.make_planner("greedy")
print(planner.plan(carried.dynamics, task, scene, scene.in_a_row()).pushes[0])
