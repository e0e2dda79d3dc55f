"""How well the data tell a parameter: a bootstrap over pushes."""

from collections.abc import Mapping, Sequence

import numpy as np
from jaxtyping import Float

from sainet.identification.parameters import (
    bounds_of,
    from_coordinate,
    to_coordinate,
)
from sainet.identification.residuals import Sample, Scale, residuals, slopes

_RESAMPLES = 2_000
_INTERVAL = (2.5, 97.5)  # percent
_BOOTSTRAP = 0x1DE47
_RIDGE = 1e-6  # of the largest slope: what the data say nothing of stays where it was


def intervals(
    values: Mapping[str, float],
    free: Sequence[str],
    scale: Scale,
    parts: Sequence[Sample],
) -> dict[str, tuple[float, float]]:
    """Return the 95 % interval of each free parameter, over pushes like these."""
    at = {name: to_coordinate(name, value) for name, value in values.items()}
    matrices, vectors = [], []
    for part in parts:
        error, slope = residuals(at, scale, part), slopes(at, free, scale, part)
        weight = 1 / np.sqrt(1 + error**2)  # of the soft l1 loss
        matrices.append(np.einsum("pn,pni,pnj->pij", weight, slope, slope))
        vectors.append(np.einsum("pn,pni,pn->pi", weight, slope, error))
    steps = _resampled_steps(np.concatenate(matrices), np.concatenate(vectors))
    draws = np.clip(np.array([at[name] for name in free]) - steps, *bounds_of(free))
    ends = np.percentile(draws, _INTERVAL, axis=0).tolist()
    return {
        name: (from_coordinate(name, low), from_coordinate(name, high))
        for name, low, high in zip(free, *ends, strict=True)
    }


def _resampled_steps(
    matrix: Float[np.ndarray, "push p p"], vector: Float[np.ndarray, "push p"]
) -> Float[np.ndarray, "resample p"]:
    """Return the Gauss-Newton step from the solution on each resample of the pushes."""
    pushes, size = vector.shape
    rng = np.random.default_rng(_BOOTSTRAP)
    counts = rng.multinomial(pushes, np.full(pushes, 1 / pushes), _RESAMPLES)
    ridge = _RIDGE * np.trace(matrix.sum(axis=0)) * np.eye(size)
    left = np.einsum("rp,pij->rij", counts, matrix) + ridge
    right = np.einsum("rp,pi->ri", counts, vector)
    return np.linalg.solve(left, right[..., None])[..., 0]
