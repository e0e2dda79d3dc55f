"""Intervals over folds and labs: whole ones are drawn, then their pushes."""

import numpy as np
import pytest
from scipy import stats

from sainet.evaluation.intervals import Folds, Sample, wilson
from sainet.evaluation.metrics import ModelErrors


def test_pushes_of_one_fold_are_correlated():
    """Folds that differ by nothing but their mean: resampling pushes misses it."""
    rng = np.random.default_rng(0)
    folds = Folds(tuple(np.repeat(np.arange(5), 40).tolist()))
    values = (np.array(folds.of_push) + rng.normal(0, 0.1, 200))[:, None]
    for told in (None, folds):
        mean, low, high = Sample(values, told).interval
        assert mean[0] == pytest.approx(values.mean())
        deviation = np.sqrt(2.0 / (200 if told is None else 5))  # of the mean
        assert high[0] - low[0] == pytest.approx(2 * 1.96 * deviation, rel=0.15)


def test_intervals_of_equal_folds_are_nearly_equal():
    values = np.random.default_rng(1).normal(0, 1, (200, 1))
    folds = Folds(tuple((np.arange(200) % 5).tolist()))
    apart, together = (
        np.ptp(Sample(values, told).interval[1:]) for told in (None, folds)
    )
    assert together == pytest.approx(apart, rel=0.5)


def test_intervals_of_labs_contain_the_mean_of_all_labs_as_often_as_they_promise():
    rng, tries = np.random.default_rng(2), 300
    places = tuple(np.repeat(np.arange(5), 20).tolist())

    def covered(folds: Folds, values: np.ndarray) -> bool:
        _, low, high = Sample(values, folds).interval
        return bool(low[0] <= 0 <= high[0])

    labs, folds = Folds(places, are_labs=True), Folds(places)
    found = []
    for _ in range(tries):
        of_lab, of_push = rng.normal(0, 1, 5), rng.normal(0, 0.5, 100)
        values = (of_lab[list(places)] + of_push)[:, None]
        found.append((covered(labs, values), covered(folds, values)))
    promised, short = np.mean(found, axis=0)
    assert 0.92 <= promised <= 0.98
    assert short < 0.90


def test_differences_between_models_in_labs_are_paired():
    """All labs differ widely, and in each the second model errs more by the same."""
    rng, places = np.random.default_rng(3), np.repeat(np.arange(5), 20)
    one = rng.normal(0, 5, 5)[places] + rng.normal(0, 1, 100)
    other = one + 0.5 + rng.normal(0, 0.1, 100)
    labs = Folds(tuple(places.tolist()), are_labs=True)
    value, low, high = Sample(other[:, None], labs).minus(Sample(one[:, None], labs))
    assert low[0] < value[0] < high[0]
    assert 0.4 < low[0] < high[0] < 0.6
    assert np.ptp(Sample(one[:, None], labs).interval[1:]) > 5


def test_chances_over_labs_are_those_of_student_also_far_from_five_per_cent():
    rng, places = np.random.default_rng(4), np.repeat(np.arange(5), 40)
    labs = Folds(tuple(places.tolist()), are_labs=True)
    none = Sample(np.zeros((200, 1)), labs)
    ratios: dict[bool, list[float]] = {True: [], False: []}
    for shift in np.tile(np.linspace(0, 3, 30), 8):
        of_lab = rng.normal(shift, 1, 5)
        wanted = stats.ttest_1samp(of_lab, 0).pvalue
        if 0.012 < wanted < 0.03 or 0.15 < wanted < 0.6:
            sample = Sample((of_lab[places] + rng.normal(0, 0.01, 200))[:, None], labs)
            ratios[wanted < 0.05].append(sample.chance(none)[0] / wanted)
    for found in ratios.values():
        assert len(found) > 20
        assert 0.75 < np.median(found) < 1.25


def test_one_lab_has_the_interval_of_its_pushes():
    values = np.random.default_rng(4).normal(0, 1, (50, 1))
    lab, plain = Folds((3,) * 50, are_labs=True), Sample(values).interval
    found = Sample(values, lab).interval
    np.testing.assert_allclose(np.ptp(found[1:]), np.ptp(plain[1:]), rtol=0.15)


def test_ratios_of_labs_are_positive_and_paired():
    rng, places = np.random.default_rng(5), np.repeat(np.arange(2), 10)
    one = np.exp(rng.normal(0, 0.5, 2)[places] + rng.normal(0, 0.3, 20))
    labs = Folds(tuple(places.tolist()), are_labs=True)
    twice = Sample(2 * one[:, None], labs).over(Sample(one[:, None], labs))
    np.testing.assert_allclose(np.ravel(twice), 2, rtol=1e-9)
    other = Sample(rng.uniform(1, 2, (20, 1)), labs)
    value, low, high = Sample(one[:, None], labs).over(other)
    assert 0 < low[0] < value[0] < high[0]


def test_a_ratio_to_two_unlike_training_runs_has_no_upper_end():
    errors = np.random.default_rng(7).gamma(4, 1, (300, 1))
    engine, alike, unlike = (
        Sample(scales * errors)
        for scales in (2.0, np.reshape([1, 1.01], (2, 1, 1)), [[[1.0]], [[1.3]]])
    )
    for below, is_known in ((alike, True), (unlike, False)):
        value, low, high = engine.over(below, trained_apart=True)
        assert 0 < low[0] < value[0]
        assert np.isfinite(high[0]) == is_known
    # An error is never negative, nor is its ratio to another.
    errors = ModelErrors({"pos_mm": unlike.values}, errors, 1.0)
    assert errors.mean("pos_mm")[1][0] == 0
    assert unlike.over(engine)[1][0] == 0


def test_quantities_and_training_runs_stay_apart():
    values = np.random.default_rng(6).normal(size=(3, 40, 2)) * [1, 100] + [0, 500]
    both = Sample(values).interval
    for quantity in (0, 1):
        alone = Sample(values[..., quantity : quantity + 1]).interval
        for one, other in zip(both, alone, strict=True):
            assert one[quantity] == pytest.approx(other[0])


def test_ratio_of_errors_of_zero_in_labs_is_zero():
    """Predictions may be exact: those of a disk that nothing touches, for example."""
    labs = Folds((0, 0, 1, 1, 2, 2), are_labs=True)
    errors, travel = np.zeros((6, 1)), np.ones((6, 1))
    found = Sample(errors, labs).over(Sample(travel, labs))
    assert [end.item() for end in found] == [0, 0, 0]


@pytest.mark.parametrize("spread", [0.01, 0.05])
def test_ratios_of_a_few_labs_have_the_t_interval_of_their_logarithms(spread):
    logarithms = spread * stats.norm.ppf(np.linspace(0.1, 0.9, 5))
    labs = Folds(tuple(range(5)), are_labs=True)
    one, other = (
        Sample(np.exp(logarithms)[:, None], labs),
        Sample(np.ones((5, 1)), labs),
    )
    value, *ends = np.ravel(one.over(other))
    half = stats.t.ppf(0.975, 4) * logarithms.std(ddof=1) / np.sqrt(5)
    np.testing.assert_allclose(np.log(ends / value), [-half, half], rtol=0.1)


def test_a_ratio_to_no_error_has_no_upper_end():
    error, none = Sample(np.ones((20, 1))), Sample(np.zeros((20, 1)))
    assert np.isnan(error.over(none)[2][0])


def test_p_is_never_below_that_of_one_resample():
    one, other = Sample(np.full((20, 2), [1.0, np.nan])), Sample(np.zeros((20, 2)))
    p, unknown = one.chance(other)
    assert p == pytest.approx(2 / 2001)
    assert p == pytest.approx(other.chance(one)[0])
    assert np.isnan(unknown)


def test_shares_of_folds_and_training_runs_are_wider_than_those_of_pushes():
    """Wilson's interval is that of independent pushes: of folds it is too narrow."""
    alike = (np.arange(200) % 5 < 2).astype(float)[:, None]
    folds = Folds(tuple((np.arange(200) % 5).tolist()))
    (share,), (low,), (high,) = Sample(alike, folds).share
    plain = Sample(alike)
    np.testing.assert_allclose(np.ravel(plain.share), [share, *wilson(share, 200)])
    assert high - low > 4 * np.ptp(plain.share[1:])
    trained = Sample(np.stack([alike, np.ones_like(alike)]))
    assert np.ptp(trained.share[1:]) > 4 * np.ptp(
        Sample(trained.mean + 0 * alike).share[1:]
    )


@pytest.mark.parametrize("share", [0.0, 1.0])
def test_shares_of_none_or_all_have_wilsons_interval_unless_of_one_push(share):
    folds = Folds(tuple((np.arange(40) % 4).tolist()))
    found = np.ravel(Sample(np.full((40, 1), share), folds).share)
    np.testing.assert_allclose(found, [share, *wilson(share, 40)])
    assert np.isnan(Sample(np.full((1, 1), share)).share[1:]).all()


def test_wilsons_interval_is_that_of_scipy():
    for solved in (0, 3, 17, 20):
        wanted = stats.binomtest(solved, 20).proportion_ci(method="wilson")
        np.testing.assert_allclose(wilson(solved / 20, 20), wanted, atol=1e-12)
