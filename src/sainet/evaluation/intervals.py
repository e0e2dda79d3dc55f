"""Means over pushes with 95 % bootstrap intervals, and paired differences."""

import numpy as np
from jaxtyping import Float
from scipy.stats import bootstrap

RESAMPLES = 2000
_SEED = 0


def mean_interval(
    values: Float[np.ndarray, "push quantity"],
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the means over pushes and the ends of their intervals."""
    low, high = _bootstrap((values,), lambda x, axis: np.mean(x, axis=axis))
    return values.mean(axis=0), low, high


def ratio_interval(
    above: Float[np.ndarray, "push quantity"], below: Float[np.ndarray, "push quantity"]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the ratio of two means over the same pushes, with its interval."""

    def ratio(x: np.ndarray, y: np.ndarray, axis: int) -> np.ndarray:
        return np.mean(x, axis=axis) / np.maximum(np.mean(y, axis=axis), 1e-12)

    low, high = _bootstrap((above, below), ratio)
    return ratio(above, below, 0), low, high


def difference_interval(
    one: Float[np.ndarray, "push quantity"], other: Float[np.ndarray, "push quantity"]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the paired difference of two means, with its interval."""
    return mean_interval(one - other)


def _bootstrap(samples: tuple, statistic) -> tuple[np.ndarray, np.ndarray]:  # noqa: ANN001
    """Return the ends of the intervals; NaN where a value is not known."""
    low, high = np.full((2, samples[0].shape[1]), np.nan)
    known = np.all([np.isfinite(sample).all(axis=0) for sample in samples], axis=0)
    if len(samples[0]) < 2 or not known.any():  # noqa: PLR2004
        return low, high
    result = bootstrap(
        tuple(sample[:, known] for sample in samples),
        statistic,
        axis=0,
        paired=len(samples) > 1,
        vectorized=True,
        n_resamples=RESAMPLES,
        batch=100,
        method="percentile",
        rng=np.random.default_rng(_SEED),
    )
    low[known] = result.confidence_interval.low
    high[known] = result.confidence_interval.high
    return low, high
