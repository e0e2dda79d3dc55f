"""Means over pushes with 95 % bootstrap intervals, and paired differences.

A network that was trained several times has an axis of trainings before that of pushes:
another training differs as another set of test pushes does. Pushes are resampled. A
handful of trainings is too few for that (the bootstrap's intervals of 5 would hold the
truth 84 times in 100, of 3 75 times): to each resample comes a draw of Student's t,
times the standard error over trainings, which gives the t interval where pushes are
many. Of a cross-validation folds are resampled, then the pushes in each: pushes of one
fold were predicted by the same network.
"""

from functools import lru_cache

import numpy as np
from jaxtyping import Float

RESAMPLES = 2000
_SEED = 0
_ENDS = (2.5, 97.5)  # percentiles

Values = Float[np.ndarray, "... push quantity"]  # maybe an axis of trainings first
Folds = tuple[int, ...]  # of each push
Interval = tuple[np.ndarray, np.ndarray, np.ndarray]  # value, low, high


def mean_interval(values: Values, folds: Folds | None = None) -> Interval:
    """Return the means over pushes (and trainings) and the ends of their intervals."""
    return _interval(_mean(values), _resampled(values, folds))


def ratio_interval(
    above: Values, below: Values, folds: Folds | None = None
) -> Interval:
    """Return the ratio of two means over the same pushes, with its interval."""

    def ratio(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return x / np.maximum(y, 1e-12)

    drawn = ratio(_resampled(above, folds), _resampled(below, folds))
    return _interval(ratio(_mean(above), _mean(below)), drawn)


def factor_interval(
    above: Values, below: Values, folds: Folds | None = None
) -> Interval:
    """Return the ratio of the means of two models, trained apart, with its interval."""
    floor = 1e-12
    drawn = _resampled(above, folds) / np.maximum(_resampled(below, folds, 1), floor)
    return _interval(_mean(above) / np.maximum(_mean(below), floor), drawn)


def difference_interval(
    one: Values, other: Values, folds: Folds | None = None
) -> Interval:
    """Return the difference of two means over the same pushes, with its interval."""
    drawn = _resampled(one, folds) - _resampled(other, folds, which=1)
    return _interval(_mean(one) - _mean(other), drawn)


def _mean(values: Values) -> np.ndarray:
    return values.mean(axis=tuple(range(values.ndim - 1)))


def _resampled(
    values: Values, folds: Folds | None, which: int = 0
) -> Float[np.ndarray, "sample quantity"]:
    """Return the mean of each resample: of the same pushes for every set of values.

    Args:
        values: to be resampled.
        folds: of a cross-validation.
        which: of two sets of trainings, whose luck is drawn apart.
    """
    whole = values.reshape(-1, *values.shape[-2:])
    trainings, pushes, quantities = whole.shape
    if pushes < 2:  # noqa: PLR2004  (one push tells nothing of others)
        return np.full((RESAMPLES, quantities), np.nan)
    shares = _shares(pushes) if folds is None else _shares_of_folds(folds)
    by_training = np.stack([shares @ one for one in whole])
    mean = by_training.mean(axis=0)
    if trainings == 1:
        return mean
    standard_error = by_training.std(axis=0, ddof=1) / np.sqrt(trainings)
    return mean + standard_error * _luck(trainings, which)[:, None]


@lru_cache(maxsize=4)
def _luck(trainings: int, which: int) -> Float[np.ndarray, " sample"]:
    """Return how far off the mean of so many trainings is, in standard errors."""
    rng = np.random.default_rng((_SEED, 1 + which, trainings))
    return rng.standard_t(trainings - 1, RESAMPLES)


@lru_cache(maxsize=4)
def _shares(count: int) -> Float[np.ndarray, "sample count"]:
    """Return how much of each resample every one of so many pushes makes up."""
    rng = np.random.default_rng((_SEED, count))
    return rng.multinomial(count, [1 / count] * count, size=RESAMPLES) / count


@lru_cache(maxsize=4)
def _shares_of_folds(folds: Folds) -> Float[np.ndarray, "sample push"]:
    """Return the shares of pushes, where folds are drawn first."""
    owner = np.unique(folds, return_inverse=True)[1]
    sizes = np.bincount(owner)
    rng = np.random.default_rng((_SEED, len(folds), len(sizes)))
    often = rng.multinomial(len(sizes), [1 / len(sizes)] * len(sizes), size=RESAMPLES)
    shares = np.zeros((RESAMPLES, len(folds)))
    for fold, size in enumerate(sizes):
        drawn = rng.multinomial(often[:, fold] * size, [1 / size] * size)
        shares[:, owner == fold] = drawn
    return shares / shares.sum(axis=1, keepdims=True)


def _interval(
    value: np.ndarray, drawn: Float[np.ndarray, "sample quantity"]
) -> Interval:
    low, high = np.percentile(drawn, _ENDS, axis=0)
    return value, low, high
