"""Bullet behind the interface of every engine."""

import sys
from importlib.util import find_spec
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from sainet.engines.base import AbstractEngine
from sainet.errors import MissingExtra
from sainet.pushes import Controls, ForceControls, PathControls
from sainet.scene import Scene, State, Trajectory, pack_motion, unpack_motion

_NEWEST_PYTHON = (3, 11)  # that PyBullet has wheels for


class BulletEngine(AbstractEngine):
    """The engine of the paper, in DIRECT mode.

    It works on the host and outside JAX: a rollout may be part of a compiled function,
    but has no gradient. The batch is shared out to a process for each core.
    """

    def __check_init__(self) -> None:
        """Raise `MissingExtra` without PyBullet."""
        if find_spec("pybullet") is None:
            raise MissingExtra(_how_to_install())

    def rollout(self, scene: Scene, initial: State, controls: Controls) -> Trajectory:
        """Return the states after each step of the controls."""
        batch, steps = scene.batch_shape, controls.steps
        shapes = (
            jax.ShapeDtypeStruct((*batch, steps, scene.body_count, 6), jnp.float32),
            jax.ShapeDtypeStruct((*batch, steps, 4), jnp.float32),
        )
        motion, pusher = jax.pure_callback(
            _HostRollout(scene, controls),
            shapes,
            _arrays(scene, initial, controls),
            vmap_method="broadcast_all",
        )
        return Trajectory(unpack_motion(motion, pusher[..., 0:2], pusher[..., 2:4]))


class _HostRollout:
    """Rolls a batch of plain arrays out; holds what is static."""

    def __init__(self, scene: Scene, controls: Controls) -> None:
        self._time_step = float(scene.time_step)
        self._drive = (
            (float(controls.pusher_mass), float(controls.damping))
            if isinstance(controls, ForceControls)
            else None
        )

    def __call__(self, arrays: dict[str, Any]) -> tuple[np.ndarray, np.ndarray]:
        from sainet.engines.bullet.pool import roll_everywhere
        from sainet.engines.bullet.world import Driven, Job

        values = {name: np.asarray(x, np.float64) for name, x in arrays.items()}
        batch = values["mass"].shape[:-1]
        flat = {n: x.reshape(-1, *x.shape[len(batch) :]) for n, x in values.items()}
        driven = None if self._drive is None else Driven(*self._drive)
        jobs = [
            Job(
                **{n: x[row] for n, x in flat.items() if n not in _FIELD},
                field=tuple(flat[n][row] for n in _FIELD) if "wave" in flat else None,
                driven=driven,
                time_step=self._time_step,
            )
            for row in range(len(flat["mass"]))
        ]
        moved = roll_everywhere(jobs)
        motion, pusher = (part.reshape(*batch, *part.shape[1:]) for part in moved)
        return motion, pusher


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
        "command": controls.position
        if isinstance(controls, PathControls)
        else controls.force,
    }
    if scene.friction_field is not None:
        arrays |= {name: getattr(scene.friction_field, name) for name in _FIELD}
    return arrays


def _how_to_install() -> str:
    if sys.version_info[:2] > _NEWEST_PYTHON:
        here = ".".join(map(str, sys.version_info[:2]))
        return (
            "The engine bullet needs PyBullet, which has no wheels for Python "
            f"{here}; use Python 3.11, or the engine planar."
        )
    return "The engine bullet needs PyBullet: pip install 'sainet[bullet]'."
