"""Bullet behind the common interface of all engines."""

import multiprocessing
import sys
from concurrent.futures import Executor
from concurrent.futures.process import BrokenProcessPool
from functools import lru_cache
from importlib.util import find_spec

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from sainet.engines.base import AbstractEngine
from sainet.engines.bullet.world import Job, Moved, roll_jobs
from sainet.runs.errors import BadScene, MissingExtra, missing_extra
from sainet.runs.workers import core_count, spawned_pool, worker_lost
from sainet.scenes.controls import Controls
from sainet.scenes.scene import Scene
from sainet.scenes.state import State, Trajectory, pack_motion, unpack_motion

_NEWEST_PYTHON = (3, 11)  # with PyBullet wheels
_FEW = 8  # pushes: up to here, one process is faster than several
_SHARES = 4  # parts of the work per process, because processes differ in speed


class BulletEngine(AbstractEngine):
    """Bullet, the paper's engine, in DIRECT mode.

    It runs on the host and has no gradient. (A compiled function would need a callback,
    which deadlocks JAX with several CPU devices.) Batches are distributed over one
    process per core.
    """

    def __check_init__(self) -> None:
        """Raise `MissingExtra` if PyBullet is not installed."""
        if find_spec("pybullet") is None:
            raise _how_to_install()

    @property
    def on_host(self) -> bool:
        """True: Bullet runs outside JAX."""
        return True

    @property
    def most_disks(self) -> int:
        """One disk for each bit of a collision mask of 31; all share the first bit."""
        return 30

    def rollout(self, scene: Scene, initial: State, controls: Controls) -> Trajectory:
        """Return the states after each step of the controls.

        Raises:
            BadScene: the scene has more disks than Bullet has collision groups.
        """
        if scene.body_count > self.most_disks:
            raise BadScene(
                f"scene has {scene.body_count} disks; Bullet supports at most "
                f"{self.most_disks}. Use fewer disks or the planar engine."
            )
        batch = scene.batch_shape
        moved = roll_everywhere(_jobs(scene, initial, controls))
        motion, pusher = (
            jnp.asarray(part.reshape(*batch, *part.shape[1:])) for part in moved
        )
        return Trajectory(unpack_motion(motion, pusher[..., 0:2], pusher[..., 2:4]))


def _jobs(scene: Scene, initial: State, controls: Controls) -> list[Job]:
    """Return the numbers that define each push of a batch."""
    axes = len(scene.batch_shape)
    arrays = _arrays(scene, initial, controls)
    rows = {
        name: np.asarray(x, np.float64).reshape(-1, *x.shape[axes:])
        for name, x in arrays.items()
    }
    return [
        Job(
            **{name: x[row] for name, x in rows.items() if name not in _FIELD},
            field=tuple(rows[n][row] for n in _FIELD) if "wave" in rows else None,
            pusher_mass=float(controls.pusher.mass),
            damping=float(controls.pusher.damping),
            time_step=float(scene.time_step),
        )
        for row in range(len(rows["mass"]))
    ]


_FIELD = ("wave", "phase", "amplitude")


def _arrays(scene: Scene, initial: State, controls: Controls) -> dict[str, Array]:
    arrays = {
        "mass": scene.mass,
        "radius": scene.radius,
        "table_friction": scene.table_friction,
        "disk_friction": scene.disk_friction,
        "pusher_friction": scene.pusher_friction,
        "pusher_radius": scene.pusher_radius,
        "motion": pack_motion(initial),
        "pusher": jnp.concatenate(
            [initial.pusher_position, initial.pusher_velocity], axis=-1
        ),
        "command": controls.command,
    }
    if scene.friction_field is not None:
        arrays |= {name: getattr(scene.friction_field, name) for name in _FIELD}
    return arrays


def _how_to_install() -> MissingExtra:
    if sys.version_info[:2] > _NEWEST_PYTHON:
        here = ".".join(map(str, sys.version_info[:2]))
        return MissingExtra(
            "The engine bullet needs PyBullet, which has no wheels for Python "
            f"{here}, where the extra 'bullet' installs nothing; use Python 3.11, or "
            "the engine planar."
        )
    return missing_extra("The engine bullet needs PyBullet", "bullet")


def roll_everywhere(jobs: list[Job]) -> Moved:
    """Return the motion of pushes simulated on all cores, byte-identical to one core.

    In a worker process the pushes run in that process: the other workers use the
    remaining cores.

    Raises:
        SainetError: a process was killed; the next call starts new processes.
    """
    if len(jobs) <= _FEW or multiprocessing.parent_process() is not None:
        return roll_jobs(jobs)
    size = -(-len(jobs) // (_SHARES * core_count()))
    shares = [jobs[start : start + size] for start in range(0, len(jobs), size)]
    try:
        done = list(_pool().map(roll_jobs, shares))
    except KeyboardInterrupt:
        _pool.cache_clear()  # interrupted processes accept no more jobs
        raise
    except BrokenProcessPool:
        _pool.cache_clear()
        raise worker_lost() from None
    return Moved(*(np.concatenate(parts) for parts in zip(*done, strict=True)))


@lru_cache
def _pool() -> Executor:
    return spawned_pool(core_count())
