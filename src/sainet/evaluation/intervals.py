"""Means over pushes with 95 % bootstrap intervals, and paired differences.

A network of several training runs has an axis of runs before that of pushes: another
run differs as another set of test pushes does. Pushes are resampled. Runs are too few
for a bootstrap (95 % intervals of 5 runs would contain the true mean 84 times in 100,
those of 3 runs 75 times). Instead, each resample gets a draw of Student's t, times the
standard error over runs, which gives the t interval where pushes are many. In a
cross-validation, folds are resampled first, then the pushes in each fold: all pushes of
a fold were predicted by the same network. Labs are resampled like folds, but are a few
of very many, for which such intervals are too short (five labs: 84 in 100 again). The
deviation of each resample is therefore multiplied, so that the interval of the mean of
labs becomes the t interval; it stays the same for all models, so that differences are
paired.
"""

import math
from dataclasses import dataclass
from functools import cached_property, lru_cache

import msgspec
import numpy as np
from jaxtyping import Float
from scipy.special import ndtri, stdtr, stdtrit

RESAMPLES = 2000
_SEED = 0
_ENDS = (2.5, 97.5)  # percentiles
_FLOOR = 1e-12  # of a denominator

Values = Float[np.ndarray, "... push quantity"]  # maybe an axis of training runs first
Interval = tuple[np.ndarray, np.ndarray, np.ndarray]  # value, low, high


@dataclass(frozen=True)
class Folds:
    """The part that each push is in: a fold of a cross-validation, or a lab."""

    of_push: tuple[int, ...]
    are_labs: bool = False

    @property
    def labs(self) -> int:
        """The number of labs; 1 for folds."""
        return len(set(self.of_push)) if self.are_labs else 1

    @property
    def widening(self) -> float:
        """Factor of deviations that makes intervals of labs those of Student's t."""
        return _student(self.labs) * (1 - 1 / self.labs) ** -0.5 if self.labs > 1 else 1


@dataclass(frozen=True, eq=False)
class Sample:
    """Values of some pushes, and their means over resamples, which are drawn once.

    Attributes:
        values: of each push and quantity, maybe with an axis of training runs first.
        folds: or labs, of all pushes.
    """

    values: Values
    folds: Folds | None = None

    @cached_property
    def mean(self) -> Float[np.ndarray, " quantity"]:
        """The means over pushes (and training runs)."""
        return self.values.mean(axis=tuple(range(self.values.ndim - 1)))

    @cached_property
    def _by_resample(self) -> tuple[np.ndarray, np.ndarray | None, int]:
        """Mean of each resample, its standard error over training runs, their number.

        Samples of as many pushes have the same resamples.
        """
        whole = self.values.reshape(-1, *self.values.shape[-2:])
        trainings, pushes, quantities = whole.shape
        if pushes < 2:  # noqa: PLR2004  (one push has no spread)
            return np.full((RESAMPLES, quantities), np.nan), None, trainings
        shares = _shares(pushes) if self.folds is None else _shares_of_folds(self.folds)
        # One product for all training runs: the shares are most of what it reads.
        together = shares @ np.moveaxis(whole, 0, 1).reshape(pushes, -1)
        by_training = together.reshape(RESAMPLES, trainings, quantities).swapaxes(0, 1)
        mean = by_training.mean(axis=0)
        if trainings == 1:
            return mean, None, trainings
        return mean, by_training.std(axis=0, ddof=1) / np.sqrt(trainings), trainings

    def drawn(self, which: int = 0) -> Float[np.ndarray, "sample quantity"]:
        """Return the mean of each resample, with the scatter of its training runs.

        Args:
            which: of two sets of training runs, whose scatter is drawn independently.
        """
        mean, standard_error, trainings = self._by_resample
        if standard_error is None:
            return mean
        return mean + standard_error * _scatter(trainings, which)[:, None]

    @property
    def interval(self) -> Interval:
        """The means and the ends of their intervals."""
        return self._interval(self.mean, self.drawn())

    @property
    def share(self) -> Interval:
        """Shares: Wilson's interval, or that over folds or labs and trainings.

        A bootstrap of pushes that all count, or none of them, has no width.
        """
        share, *ends = self.interval
        is_plain = self.folds is None and self.values.ndim == 2  # noqa: PLR2004
        takes_wilson = np.isfinite(ends[0]) & (is_plain | (share == 0) | (share == 1))
        bounds = wilson(share, self.values.shape[-2])
        low, high = np.clip(np.where(takes_wilson, bounds, ends), 0, 1)
        return share, low, high

    def minus(self, other: "Sample") -> Interval:
        """Return the differences of the means over the same pushes."""
        return self._interval(self.mean - other.mean, self.drawn() - other.drawn(1))

    def chance(self, other: "Sample") -> Float[np.ndarray, " quantity"]:
        """Return p, two-sided, of differences of the means over the same pushes.

        Twice the share of resamples on the other side of zero, of at least one: at most
        about 0.05 where the interval of `minus`, whose ends lie between resamples,
        leaves out zero.
        """
        value = self.mean - other.mean
        drawn = value + self._widening * (self.drawn() - other.drawn(1) - value)
        beyond = np.minimum((drawn >= 0).sum(axis=0), (drawn <= 0).sum(axis=0))
        p = np.minimum(2 * (beyond + 1) / (RESAMPLES + 1), 1.0)
        if self.folds and (labs := self.folds.labs) > 1:  # p has the tails of t
            p = 2 * stdtr(labs - 1, _student(labs) * ndtri(p / 2))
        return np.where(np.isnan(drawn).any(axis=0), np.nan, p)

    def over(self, other: "Sample", *, trained_apart: bool = False) -> Interval:
        """Return the ratios of the means, none negative, over the same pushes.

        The upper end is unknown where it would rest on denominators that are drawn
        below zero: few training runs scatter widely.

        Args:
            other: the denominator.
            trained_apart: the denominators are of another model.
        """
        below = other.drawn(int(trained_apart))
        drawn = np.maximum(self.drawn(), 0) / np.maximum(below, _FLOOR)
        value = self.mean / np.maximum(other.mean, _FLOOR)
        if self._widening != 1:  # of the logarithm: a ratio of labs stays positive
            drawn = value * (drawn / np.maximum(value, _FLOOR)) ** self._widening
        low, high = np.percentile(drawn, _ENDS, axis=0)
        is_known = np.percentile(below, 100 - _ENDS[1], axis=0) > 0
        return value, low, np.where(is_known, high, np.nan)

    @property
    def _widening(self) -> float:
        return 1.0 if self.folds is None else self.folds.widening

    def _interval(
        self, value: np.ndarray, drawn: Float[np.ndarray, "sample quantity"]
    ) -> Interval:
        if self._widening != 1:
            drawn = value + self._widening * (drawn - value)
        low, high = np.percentile(drawn, _ENDS, axis=0)
        return value, low, high


def _student(count: int) -> float:
    """Return half an interval of a mean of t, over that of a normal distribution."""
    high = _ENDS[1] / 100
    return float(stdtrit(count - 1, high) / ndtri(high))


@lru_cache(maxsize=4)
def _scatter(trainings: int, which: int) -> Float[np.ndarray, " sample"]:
    """Return the deviation of a mean over training runs, in standard errors."""
    rng = np.random.default_rng((_SEED, 1 + which, trainings))
    return rng.standard_t(trainings - 1, RESAMPLES)


@lru_cache(maxsize=4)
def _shares(count: int) -> Float[np.ndarray, "sample count"]:
    """Return the share of every push in each resample."""
    rng = np.random.default_rng((_SEED, count))
    return rng.multinomial(count, [1 / count] * count, size=RESAMPLES) / count


@lru_cache(maxsize=4)
def _shares_of_folds(folds: Folds) -> Float[np.ndarray, "sample push"]:
    """Return the shares of pushes, where folds are drawn first."""
    owner = np.unique(folds.of_push, return_inverse=True)[1]
    sizes = np.bincount(owner)
    pushes = len(owner)
    rng = np.random.default_rng((_SEED, pushes, len(sizes)))
    often = rng.multinomial(len(sizes), [1 / len(sizes)] * len(sizes), size=RESAMPLES)
    shares = np.zeros((RESAMPLES, pushes))
    for fold, size in enumerate(sizes):
        drawn = rng.multinomial(often[:, fold] * size, [1 / size] * size)
        shares[:, owner == fold] = drawn
    return shares / shares.sum(axis=1, keepdims=True)


def wilson(share: float | np.ndarray, count: int) -> Float[np.ndarray, "end *shares"]:
    """Return both ends of Wilson's interval of shares of a number of things."""
    squared = ndtri(_ENDS[1] / 100) ** 2 / count
    half = np.sqrt(squared * (share * (1 - share) + squared / 4))
    middle = share + squared / 2
    return np.clip([middle - half, middle + half] / (1 + squared), 0, 1)


class Estimate(msgspec.Struct, frozen=True):
    """A number with the ends of its 95 % interval; None where it is unknown."""

    value: float | None = None
    low: float | None = None
    high: float | None = None


def estimate(found: Interval, body: int, *, with_interval: bool = True) -> Estimate:
    """Return one of several numbers with its interval."""
    value, low, high = (known(float(part[body])) for part in found)
    return Estimate(value, low, high) if with_interval else Estimate(value)


def known(value: float) -> float | None:
    """Return a number that JSON can hold; None where it is unknown."""
    return float(value) if math.isfinite(value) else None


def folds_of(folds: np.ndarray, *, are_labs: bool) -> Folds | None:
    """Return the folds or labs of samples, None if a sample is in none."""
    return Folds(tuple(folds.tolist()), are_labs) if (folds >= 0).all() else None
