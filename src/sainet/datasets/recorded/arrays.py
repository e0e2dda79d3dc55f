"""Recorded pushes as the arrays of a store, chunk by chunk, with s-bar beside them."""

from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Int

from sainet.datasets.predictions import simulate
from sainet.datasets.recorded.push import RecordedPush
from sainet.datasets.schema import RECORDED, Arrays, StoreInfo, simulated_name
from sainet.datasets.writer import create_arrays, finish, write_chunk
from sainet.engines.simulator import simulator_named
from sainet.scenes.scene import TIME_STEP

STORED_ENGINES = ("planar", "planar-true")  # whose s-bar imports keep
_CHUNK_SIZE = 250  # pushes
_CHUNK_STEPS = 300_000  # of all bodies, so that chunks of long pushes stay small


@dataclass(frozen=True, kw_only=True)
class SceneProperties:
    """What does not move, the same in every push of a store."""

    mass: tuple[float, ...]  # kg
    radius: tuple[float, ...]  # m
    pusher_radius: float  # m
    contact_friction: float
    table_friction: float

    def to_dict(self) -> dict[str, Any]:
        """Return them as JSON values."""
        return {
            k: list(v) if isinstance(v, tuple) else v for k, v in vars(self).items()
        }

    def arrays(self, pushes: int) -> Arrays:
        """Return them as arrays of a store."""
        every, rows = np.ones(pushes), np.ones((pushes, 1))
        return {
            "mass": rows * np.array(self.mass)[None],
            "radius": rows * np.array(self.radius)[None],
            "table_friction": every * self.table_friction,
            "disk_friction": every * self.contact_friction,
            "pusher_friction": every * self.contact_friction,
            "pusher_radius": every * self.pusher_radius,
        }


def write_pushes(
    folder: Path, pushes: Sequence[RecordedPush], scene: SceneProperties
) -> None:
    """Write a store of recorded pushes.

    Args:
        folder: of the run.
        pushes: at least one, all of as many bodies as the scene.
        scene: of all pushes.

    Raises:
        Diverged: an assumed engine left the numbers.
        BadInput: the disk is full.
    """
    info = store_info(pushes)
    create_arrays(folder, info)
    repeats = numbered([push.plan for push in pushes])
    for index in range(info.chunks):
        part = pushes[info.chunk_slice(index)]
        # Always a whole chunk, so that the last one compiles nothing of its own.
        whole = [part[i % len(part)] for i in range(min(info.chunk_size, info.pushes))]
        arrays = chunk_arrays(whole, scene, info)
        known = {name: array[: len(part)] for name, array in arrays.items()}
        if info.has_repeats:
            known["repeat"] = repeats[info.chunk_slice(index)]
        write_chunk(folder, info, index, known)
    finish(folder, info)


def store_info(pushes: Sequence[RecordedPush]) -> StoreInfo:
    """Return what the store of such pushes has in common."""
    steps = max(push.held_steps for push in pushes)
    named = {push.group for push in pushes} - {""}
    limit = _CHUNK_STEPS // (steps * pushes[0].bodies)
    return StoreInfo(
        kind="robot",
        pushes=len(pushes),
        bodies=pushes[0].bodies,
        steps=steps,
        chunk_size=max(1, min(_CHUNK_SIZE, limit)),
        time_step=TIME_STEP,
        engine=RECORDED,
        assumed_engines=STORED_ENGINES,
        groups=tuple(sorted(named)),
        has_repeats=all(push.plan for push in pushes),
    )


def chunk_arrays(
    pushes: Sequence[RecordedPush], scene: SceneProperties, info: StoreInfo
) -> Arrays:
    """Return every array of some pushes; beyond its end a push holds its command."""
    known = scene.arrays(len(pushes)) | _motion(pushes, info) | _path(pushes, info)
    known = {name: value.astype(np.float32) for name, value in known.items()}
    finite = np.isfinite(known["truth"])
    arrays = known | {
        "steps": np.array([push.held_steps for push in pushes], np.int32),
        "group": np.array([_code(push, info) for push in pushes], np.int32),
        "pose_observed": np.all(finite[..., :3], axis=(-2, -1)),
        "rate_observed": np.all(finite[..., 3:], axis=(-2, -1)),
        "truth_pusher": known["command_position"],
    }
    names = [push.name for push in pushes]
    simulated = {
        simulated_name(engine): simulate(simulator_named(engine), arrays, info, names)
        for engine in info.assumed_engines
    }
    return arrays | simulated


def _code(push: RecordedPush, info: StoreInfo) -> int:
    return info.groups.index(push.group) if push.group else 0


def _motion(pushes: Sequence[RecordedPush], info: StoreInfo) -> Arrays:
    """Return the truth where it is known, and the state before the push, at rest."""
    initial = np.zeros((len(pushes), info.bodies, 6))
    truth = np.full((len(pushes), info.steps, info.bodies, 6), np.nan)
    for row, push in enumerate(pushes):
        initial[row, :, :3] = push.initial
        truth[row, : push.steps] = push.motion
    return {"initial": initial, "truth": truth}


def _path(pushes: Sequence[RecordedPush], info: StoreInfo) -> Arrays:
    position = np.zeros((len(pushes), info.steps, 2))
    velocity = np.zeros_like(position)
    for row, push in enumerate(pushes):
        position[row, : push.steps] = push.pusher
        position[row, push.steps :] = push.pusher[-1]
        velocity[row, : push.steps] = push.pusher_velocity
    return {
        "initial_pusher": np.stack([push.initial_pusher for push in pushes]),
        "command_position": position,
        "command_velocity": velocity,
    }


def numbered(plans: Sequence[Hashable]) -> Int[np.ndarray, " push"]:
    """Return a number for each push: equal plans share it, the first one's is 0."""
    known = {plan: number for number, plan in enumerate(dict.fromkeys(plans))}
    return np.array([known[plan] for plan in plans], np.int32)
