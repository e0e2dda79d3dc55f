"""Intervals of identified parameters: a bootstrap over pushes."""

from collections.abc import Mapping, Sequence

import numpy as np
from jaxtyping import Bool, Float

from sainet.identification.parameters import (
    BOUNDS,
    bounds_of,
    from_coordinate,
    to_coordinate,
)
from sainet.identification.residuals import Sample, Scale, residuals, slopes

_RESAMPLES = 2_000
_INTERVAL = (2.5, 97.5)  # percent
_BOOTSTRAP = 0x1DE47
_RIDGE = 1e-6  # fraction of all curvature, below which a parameter has no effect
# A resample contains none of k pushes with a probability below e^-k, and then its step
# is zero: from four pushes on, this is rarer than either tail of the interval.
_LEAST_PUSHES = 4


def intervals(
    values: Mapping[str, float],
    free: Sequence[str],
    scale: Scale,
    parts: Sequence[Sample],
) -> dict[str, tuple[float, float]]:
    """Return the 95 % interval of each free parameter.

    A parameter that affects fewer than four pushes has the whole search range as its
    interval: pushes with zero slope resample to zero steps, a false certainty.
    """
    at = {name: to_coordinate(name, value) for name, value in values.items()}
    matrices, vectors = [], []
    for part in parts:
        error, slope = residuals(at, scale, part), slopes(at, free, scale, part)
        weight = 1 / np.sqrt(1 + error**2)  # of the soft l1 loss
        matrices.append(np.einsum("pn,pni,pnj->pij", weight, slope, slope))
        vectors.append(np.einsum("pn,pni,pn->pi", weight, slope, error))
    matrix, vector = np.concatenate(matrices), np.concatenate(vectors)
    identifiable = _is_identifiable(matrix)
    if not identifiable.any():  # a Gauss-Newton step may have no solution
        return {name: BOUNDS[name] for name in free}
    steps = _resampled_steps(matrix, vector)
    draws = np.clip(np.array([at[name] for name in free]) - steps, *bounds_of(free))
    lows, highs = np.percentile(draws, _INTERVAL, axis=0).tolist()
    return {
        name: (from_coordinate(name, low), from_coordinate(name, high))
        if is_identifiable
        else BOUNDS[name]
        for name, low, high, is_identifiable in zip(
            free, lows, highs, identifiable, strict=True
        )
    }


def _is_identifiable(matrix: Float[np.ndarray, "push p p"]) -> Bool[np.ndarray, " p"]:
    """Return whether a parameter affects more than its three most affected pushes."""
    curvature = np.sort(np.einsum("pii->pi", matrix), axis=0)
    return curvature[: 1 - _LEAST_PUSHES].sum(axis=0) > _ridge(matrix)


def _ridge(matrix: Float[np.ndarray, "push p p"]) -> float:
    return _RIDGE * float(np.trace(matrix.sum(axis=0)))


def _resampled_steps(
    matrix: Float[np.ndarray, "push p p"], vector: Float[np.ndarray, "push p"]
) -> Float[np.ndarray, "resample p"]:
    """Return the Gauss-Newton step from the solution for each resample."""
    pushes, size = vector.shape
    rng = np.random.default_rng(_BOOTSTRAP)
    counts = rng.multinomial(pushes, np.full(pushes, 1 / pushes), _RESAMPLES)
    left = np.einsum("rp,pij->rij", counts, matrix) + _ridge(matrix) * np.eye(size)
    right = np.einsum("rp,pi->ri", counts, vector)
    return np.linalg.solve(left, right[..., None])[..., 0]
