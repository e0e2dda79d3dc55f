"""Intervals of a cross-validation: whole folds are drawn, then their pushes."""

import numpy as np
import pytest

from sainet.evaluation.intervals import Sample


def test_pushes_of_one_fold_are_correlated():
    """Folds that differ by nothing but their mean: resampling pushes misses it."""
    rng = np.random.default_rng(0)
    folds = tuple(np.repeat(np.arange(5), 40).tolist())
    values = (np.array(folds) + rng.normal(0, 0.1, 200))[:, None]
    for told in (None, folds):
        mean, low, high = Sample(values, told).interval
        assert mean[0] == pytest.approx(values.mean())
        deviation = np.sqrt(2.0 / (200 if told is None else 5))  # of the mean
        assert high[0] - low[0] == pytest.approx(2 * 1.96 * deviation, rel=0.15)


def test_intervals_of_equal_folds_are_nearly_equal():
    values = np.random.default_rng(1).normal(0, 1, (200, 1))
    folds = tuple((np.arange(200) % 5).tolist())
    apart, together = (
        np.ptp(Sample(values, told).interval[1:]) for told in (None, folds)
    )
    assert together == pytest.approx(apart, rel=0.5)
