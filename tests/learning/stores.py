"""Small stores: pushes made up by hand, and a few that the planar engine made."""

from functools import lru_cache
from pathlib import Path

import numpy as np

from sainet.datasets.config import GenerateConfig
from sainet.datasets.generate import generate
from sainet.datasets.schema import StoreInfo
from sainet.datasets.store import Store, open_store
from sainet.datasets.writer import write_store
from sainet.scenes.scene import TIME_STEP

# 5 steps of motion, 30 of rest, rounded up to 40.
QUIET = GenerateConfig(
    pushes=24, stroke_mm=(1.0,), hold_steps=30, noise_level="none", chunk_size=8
)


@lru_cache
def quiet_store(session_folder: Path) -> Store:
    """Simulated pushes without any noise, the same for a whole session."""
    return generate(QUIET, session_folder / "quiet-store")


def info_of(pushes: int, **changes) -> StoreInfo:
    """What a small made-up store of robot pushes has in common."""
    settings = {
        "kind": "robot",
        "pushes": pushes,
        "bodies": 2,
        "steps": 12,
        "chunk_size": 5,
        "time_step": TIME_STEP,
        "engine": "planar",
        "assumed_engines": ("planar",),
        "seed": 0,
    }
    return StoreInfo(**(settings | changes))


def made_up(info: StoreInfo, lengths=None, seed: int = 0) -> dict[str, np.ndarray]:
    """Arrays of smooth random pushes; the mass of disk 1 identifies the push."""
    rng = np.random.default_rng(seed)
    size, bodies, steps = info.pushes, info.bodies, info.steps
    lengths = np.full(size, steps) if lengths is None else np.asarray(lengths)
    path = rng.uniform(0, 2e-4, (size, steps, 2)).cumsum(1)
    initial = np.zeros((size, bodies, 6))
    initial[:, :, 0] = 0.112 * np.arange(bodies)
    initial[..., :3] += rng.uniform(0, 1e-3, (size, bodies, 3))
    pusher = initial[:, 0, :2] - [0.06, 0.0]
    exists = np.arange(steps) < lengths[:, None]
    arrays = {
        "mass": rng.uniform(0.9, 1.1, (size, bodies)),
        "radius": rng.uniform(0.05, 0.06, (size, bodies)),
        "steps": lengths,
        "group": np.zeros(size),
        "initial": initial,
        "initial_pusher": pusher,
        "truth": wander(rng, initial, steps),
        "truth_pusher": pusher[:, None] + path,
        "pose_observed": exists,
        "rate_observed": exists,
        "command_position": pusher[:, None] + path,
        "command_velocity": np.diff(path, axis=1, prepend=0) / info.time_step,
        "simulated_planar": wander(rng, initial, steps),
    }
    arrays["mass"][:, 0] = 1 + np.arange(size)
    names = ("table_friction", "disk_friction", "pusher_friction")
    return arrays | dict.fromkeys((*names, "pusher_radius"), np.full(size, 0.0048))


def wander(rng: np.random.Generator, initial: np.ndarray, steps: int) -> np.ndarray:
    """Motions ``[push, time, body, 6]`` whose poses follow from their velocities."""
    size, bodies, _ = initial.shape
    rate = rng.normal(0, 0.01, (size, steps, bodies, 3)).cumsum(1)
    pose = initial[:, None, :, :3] + (TIME_STEP * rate).cumsum(1)
    return np.concatenate([pose, rate], axis=-1)


def write(folder: Path, info: StoreInfo, arrays: dict[str, np.ndarray]) -> Store:
    """The store of some arrays."""
    folder.mkdir(parents=True, exist_ok=True)
    write_store(folder, info, arrays)
    return open_store(folder)


def single(arrays: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """The arrays as a store keeps them: numbers in single precision."""
    return {
        k: v.astype(np.float32) if v.dtype == float else v for k, v in arrays.items()
    }


def end_points_alone(arrays: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Pushes with only the last pose observed."""
    push, last = np.arange(len(arrays["steps"])), arrays["steps"] - 1
    truth = np.full_like(arrays["truth"], np.nan)
    truth[push, last, :, :3] = arrays["truth"][push, last, :, :3]
    seen = np.zeros_like(arrays["pose_observed"])
    seen[push, last] = True
    unseen = np.zeros_like(seen)
    return arrays | {"truth": truth, "pose_observed": seen, "rate_observed": unseen}
