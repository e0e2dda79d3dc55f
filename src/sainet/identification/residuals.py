"""Errors of an engine at observed steps, their derivatives, and intervals from them.

The intervals of the parameters are a bootstrap over pushes; repeats stay together.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from sainet.datasets.batch import PushBatch, shared_lengths, to_batch
from sainet.datasets.store import Store
from sainet.identification.parameters import (
    BOUNDS,
    Own,
    bounds_of,
    camera_at,
    from_coordinate,
    to_coordinates,
    values_at,
    with_values,
)

_LOOKS = 8  # observed poses of a push that are compared, evenly spaced
_BATCH = 256  # pushes at a time


@dataclass(frozen=True)
class Sample:
    """Pushes of similar length, and the steps at which their poses are compared."""

    batch: PushBatch
    steps: Int[np.ndarray, "push look"]  # observed steps, the last one repeated
    kinds: Int[np.ndarray, " push"]  # equal numbers: repeats of one push
    own: Own = None  # an engine of the user's own; None: the planar engine

    @cached_property
    def inputs(self) -> tuple[PushBatch, Int[Array, "row look"], Own]:
        """The last arguments of `pose_errors`: rows of few numbers, with repeats."""
        count = len(self.steps)
        unit = 2 ** max((count - 1).bit_length() - 3, 0)
        rows = np.resize(np.arange(count), -(-count // unit) * unit)
        some = jax.tree.map(lambda x: x[rows], self.batch)
        return some, jnp.asarray(self.steps[rows]), self.own


@dataclass(frozen=True)
class Scale:
    """Root mean square errors at the initial values, which scale all errors."""

    position: float  # m
    rotation: float  # rad


def samples(store: Store, own: Own = None) -> list[Sample]:
    """Return the observed pushes of a store, in batches of similar length.

    Args:
        store: of the pushes.
        own: an engine of the user's own; None: the planar engine.
    """
    lengths = shared_lengths(store.read(slice(None), ("steps",))["steps"])
    found, kinds = [], store.repeats()
    for length in np.unique(lengths):
        same = np.flatnonzero(lengths == length)
        for start in range(0, len(same), _BATCH):
            part = store.take(rows := same[start : start + _BATCH])
            batch = to_batch(part.read(slice(None)), part.info, steps=int(length))
            seen = np.asarray(batch.pose_observed).any(axis=1)
            if seen.any():
                batch = jax.tree.map(lambda x, seen=seen: x[seen], batch)
                looks = _looks(np.asarray(batch.pose_observed))
                found.append(Sample(batch, looks, kinds[rows][seen], own))
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
    own: Own = None,
) -> Float[Array, "push look body 3"]:
    """Return predicted minus observed poses (m, m, rad); differentiable in values."""
    scene, engine = with_values(batch.scene, values, own)
    offset = camera_at(values)
    start = batch.initial.with_pusher_moved(offset)
    controls = batch.controls.moved(offset)
    pose = engine.rollout(scene, start, controls).states.pose
    looks = steps[:, :, None, None]
    return jnp.take_along_axis(pose - batch.measured, looks, axis=1)


Values = dict[str, Array]


@eqx.filter_jit
def _residual(
    free: Values, fixed: Values, sizes: Array, part: tuple[PushBatch, Array, Own]
) -> Array:
    error = pose_errors(values_at(free | fixed), *part)
    scaled = error / jnp.broadcast_to(sizes, error.shape)
    # Every push has the same weight, whatever the number of compared steps.
    return scaled.reshape(len(scaled), -1) / jnp.sqrt(1.0 * part[1].shape[1])


_slope = eqx.filter_jit(jax.jacfwd(_residual))


def residuals(
    coordinates: Mapping[str, float], scale: Scale, sample: Sample
) -> Float[np.ndarray, "push number"]:
    """Return the scaled errors of each push (dimensionless)."""
    found = _residual(*_arguments(coordinates, (), scale, sample))
    return np.asarray(found, np.float64)[: len(sample.steps)]


def slopes(
    coordinates: Mapping[str, float], free: Sequence[str], scale: Scale, sample: Sample
) -> Float[np.ndarray, "push number parameter"]:
    """Return forward-mode derivatives of the scaled errors by the free parameters."""
    found = _slope(*_arguments(coordinates, free, scale, sample))
    count = len(sample.steps)
    return np.stack([np.asarray(found[n], np.float64)[:count] for n in free], axis=-1)


def _arguments(
    coordinates: Mapping[str, float], free: Sequence[str], scale: Scale, sample: Sample
) -> tuple[Values, Values, Array, tuple[PushBatch, Array, Own]]:
    tree = {name: jnp.float32(value) for name, value in coordinates.items()}
    chosen = {name: tree.pop(name) for name in free}
    sizes = jnp.array([scale.position, scale.position, scale.rotation], jnp.float32)
    return chosen, tree, sizes, sample.inputs


_RESAMPLES = 2_000
_INTERVAL = (2.5, 97.5)  # percent
_BOOTSTRAP = 0x1DE47
_RIDGE = 1e-6  # fraction of all curvature, below which a parameter has no effect
# A resample contains none of k pushes with a probability below e^-k, and then its step
# is zero: from four pushes on, this is rarer than either tail of the interval.
LEAST_PUSHES = 4


def intervals(
    values: Mapping[str, float],
    free: Sequence[str],
    scale: Scale,
    parts: Sequence[Sample],
) -> dict[str, tuple[float, float]]:
    """Return the 95 % interval of each free parameter.

    Repeats of a push share most of their error, so they are resampled together. A
    parameter that affects fewer than four different pushes has the whole search range
    as its interval: pushes with zero slope resample to zero steps, a false certainty.
    """
    at = to_coordinates(values)
    matrices, vectors = [], []
    for part in parts:
        error, slope = residuals(at, scale, part), slopes(at, free, scale, part)
        weight = 1 / np.sqrt(1 + error**2)  # of the soft l1 loss
        matrices.append(np.einsum("pn,pni,pnj->pij", weight, slope, slope))
        vectors.append(np.einsum("pn,pni,pn->pi", weight, slope, error))
    kinds = np.concatenate([part.kinds for part in parts])
    matrix, vector = (_sums(np.concatenate(x), kinds) for x in (matrices, vectors))
    vague = ~_is_identifiable(matrix)
    whole = {n: BOUNDS[n] for n, is_vague in zip(free, vague, strict=True) if is_vague}
    if len(whole) == len(free):  # a Gauss-Newton step may have no solution
        return whole
    steps = _resampled_steps(matrix, vector)
    draws = np.clip(np.array([at[name] for name in free]) - steps, *bounds_of(free))
    ends = zip(free, *np.percentile(draws, _INTERVAL, axis=0).tolist(), strict=True)
    found = {n: (from_coordinate(n, a), from_coordinate(n, b)) for n, a, b in ends}
    return found | whole


def _sums(values: np.ndarray, kinds: Int[np.ndarray, " push"]) -> np.ndarray:
    """Return the sum over the repeats of each push, in the order of the first ones."""
    _, first, kind = np.unique(kinds, return_index=True, return_inverse=True)
    sums = np.zeros_like(values)
    np.add.at(sums, first[kind], values)
    return sums[np.sort(first)]


def _is_identifiable(matrix: Float[np.ndarray, "kind p p"]) -> Bool[np.ndarray, " p"]:
    """Return whether more than the three most affected kinds depend on a parameter."""
    curvature = np.sort(np.einsum("pii->pi", matrix), axis=0)
    return curvature[: 1 - LEAST_PUSHES].sum(axis=0) > _ridge(matrix)


def _ridge(matrix: Float[np.ndarray, "kind p p"]) -> float:
    return _RIDGE * float(np.trace(matrix.sum(axis=0)))


def _resampled_steps(
    matrix: Float[np.ndarray, "kind p p"], vector: Float[np.ndarray, "kind p"]
) -> Float[np.ndarray, "resample p"]:
    """Return the Gauss-Newton step from the solution for each resample."""
    kinds, size = vector.shape
    rng = np.random.default_rng(_BOOTSTRAP)
    counts = rng.multinomial(kinds, np.full(kinds, 1 / kinds), _RESAMPLES)
    left = np.einsum("rp,pij->rij", counts, matrix) + _ridge(matrix) * np.eye(size)
    right = np.einsum("rp,pi->ri", counts, vector)
    return np.linalg.solve(left, right[..., None])[..., 0]
