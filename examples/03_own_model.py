"""Compare a model of your own with SAIN, and control with it: a function on arrays."""

import numpy as np

import sainet as sn


def predict(
    scene: sn.Scene, initial: sn.State, controls: sn.PathControls
) -> np.ndarray:
    """Carry disk 1 with the pusher; return poses [push, time, body, 3] (m, m, rad)."""
    moved = controls.position - initial.pusher_position[:, None]
    poses = np.zeros((*moved.shape[:2], initial.body_count, 3))
    poses[..., :2] = initial.position[:, None]
    poses[:, :, 0, :2] += moved
    # Disk 2 gives way, along the line of both centres.
    between = poses[:, :, 1, :2] - poses[:, :, 0, :2]
    distance = np.linalg.norm(between, axis=-1, keepdims=True)
    overlap = np.maximum(scene.radius.sum(axis=-1)[:, None, None] - distance, 0)
    poses[:, :, 1, :2] += overlap * between / distance
    return poses


carried = sn.from_function(predict, name="carried")
pushes = sn.generate(sn.GenerateConfig(pushes=20, chunk_size=20, seed=1))
table = sn.evaluate({"physics": "physics", "carried": carried, "sain": "sain"}, pushes)
print(table)

# One episode with each model, towards the same goal in the same simulated world.
config = sn.ControlConfig(trials=1, pushes=20)
for model in (carried, "sain"):
    (episode,) = sn.run_trials(config, model=model)
    away = f"{episode.final_mm:.1f} mm from the goal"
    print(f"{episode.model}: {episode.reason} after {episode.pushes} pushes, {away}")
