"""Errors of an engine at observed steps, and their derivatives by its parameters."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from sainet.datasets.batch import PushBatch, to_batch
from sainet.datasets.store import Store
from sainet.identification.parameters import camera_at, values_at, with_values

_LOOKS = 8  # observed poses of a push that are compared, evenly spaced
_BATCH = 256  # pushes at a time


@dataclass(frozen=True)
class Sample:
    """Pushes of one length, and the steps at which their poses are compared."""

    batch: PushBatch
    steps: Int[np.ndarray, "push look"]  # observed steps, the last one repeated


@dataclass(frozen=True)
class Scale:
    """Root mean square errors at the initial values, which scale all errors."""

    position: float  # m
    rotation: float  # rad


def samples(store: Store) -> list[Sample]:
    """Return the observed pushes of a store, in batches of equal length."""
    lengths = store.read(slice(None), ("steps",))["steps"]
    found = []
    for length in np.unique(lengths):
        same = np.flatnonzero(lengths == length)
        for start in range(0, len(same), _BATCH):
            part = store.take(same[start : start + _BATCH])
            batch = to_batch(part.read(slice(None)), part.info, steps=int(length))
            seen = np.asarray(batch.pose_observed).any(axis=1)
            if seen.any():
                batch = jax.tree.map(lambda x, seen=seen: x[seen], batch)
                found.append(Sample(batch, _looks(np.asarray(batch.pose_observed))))
    return found


def _looks(observed: np.ndarray) -> Int[np.ndarray, "push look"]:
    """Return up to `_LOOKS` observed steps of each push, always with the last one."""
    count = min(_LOOKS, int(observed.sum(axis=1).max()))
    rows = []
    for push in observed:
        known = np.flatnonzero(push)
        share = np.arange(1, count + 1) / count
        rows.append(known[np.ceil(share * len(known)).astype(int) - 1])
    return np.array(rows)


@eqx.filter_jit
def pose_errors(
    values: Mapping[str, Float[Array, ""]],
    batch: PushBatch,
    steps: Int[Array, "push look"],
) -> Float[Array, "push look body 3"]:
    """Return predicted minus observed poses (m, m, rad); differentiable in values."""
    scene, engine = with_values(batch.scene, values)
    offset = camera_at(values)
    start, controls = (
        batch.initial.with_pusher_moved(offset),
        batch.controls.moved(offset),
    )
    states = engine.rollout(scene, start, controls).states
    pose = jnp.concatenate([states.position, states.angle[..., None]], axis=-1)
    looks = steps[:, :, None, None]
    return jnp.take_along_axis(pose - batch.measured, looks, axis=1)


@eqx.filter_jit
def _residual(
    free: dict, fixed: dict, sizes: Array, batch: PushBatch, steps: Array
) -> Array:
    error = pose_errors(values_at(free | fixed), batch, steps)
    scaled = error / jnp.broadcast_to(sizes, error.shape)
    # Every push has the same weight, whatever the number of compared steps.
    return scaled.reshape(len(scaled), -1) / jnp.sqrt(1.0 * steps.shape[1])


_slope = eqx.filter_jit(jax.jacfwd(_residual))


def residuals(
    coordinates: Mapping[str, float], scale: Scale, sample: Sample
) -> Float[np.ndarray, "push number"]:
    """Return the scaled errors of each push (dimensionless)."""
    found = _residual(*_arguments(coordinates, (), scale, sample))
    return np.asarray(found, np.float64)


def slopes(
    coordinates: Mapping[str, float],
    free: Sequence[str],
    scale: Scale,
    sample: Sample,
) -> Float[np.ndarray, "push number parameter"]:
    """Return forward-mode derivatives of the scaled errors by the free parameters."""
    found = _slope(*_arguments(coordinates, free, scale, sample))
    return np.stack([np.asarray(found[name], np.float64) for name in free], axis=-1)


def _arguments(
    coordinates: Mapping[str, float],
    free: Sequence[str],
    scale: Scale,
    sample: Sample,
) -> tuple[dict, dict, Array, PushBatch, Array]:
    tree = {name: jnp.float32(value) for name, value in coordinates.items()}
    chosen = {name: tree.pop(name) for name in free}
    sizes = jnp.array([scale.position, scale.position, scale.rotation], jnp.float32)
    return chosen, tree, sizes, sample.batch, jnp.asarray(sample.steps)
