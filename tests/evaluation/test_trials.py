"""Paired tests of trials: exact ones of single trials, and those over labs."""

import numpy as np
import pytest
import xarray as xr
from scipy import stats

from sainet.evaluation.measurements import Header, Measurements
from sainet.evaluation.trials import compare_trials, trial_rows
from sainet.models.identity import ModelId


def measured(solved, fold, has_labs=True, **others) -> Measurements:
    """Trials of physics and of IN: their measurements, `[model, trial]`."""
    solved = np.asarray(solved, float)
    trial = ("model", "sample")
    names = ("solved", "ended", "pushes", "final_mm")
    data = xr.Dataset({name: (trial, others.get(name, solved)) for name in names})
    seconds = others.get("decision_s", solved)[..., None]
    data["decision_s"] = (*trial, "decision"), seconds
    samples = np.arange(solved.shape[1], dtype=np.int32)
    data = data.assign_coords(
        condition=("sample", 0 * samples),
        fold=("sample", fold),
        row=("sample", samples),
    )
    models = (ModelId(kind="physics"), ModelId(kind="in"))
    return Measurements(data, Header(models=models, has_labs=has_labs))


def p_of(*labs: tuple[int, int], trials: int) -> float:
    """p of two models: how many trials each solved in each lab, of as many."""
    order = np.arange(trials)
    solved = np.array(
        [[order < few for few in model] for model in zip(*labs, strict=True)]
    )
    solved = solved.reshape(2, -1)
    found = measured(solved, np.arange(solved.shape[1], dtype=np.int32) // trials)
    return next(test.p for test in compare_trials(found) if test.measure == "solved")


def test_one_lab_cannot_show_how_far_labs_differ():
    assert p_of((0, 20), trials=20) == 1


@pytest.mark.parametrize(("labs", "least"), [(2, 0.5), (3, 0.18), (5, 0.016)])
def test_a_few_labs_of_one_trial_each_show_little(labs, least):
    assert p_of(*[(0, 1)] * labs, trials=1) == pytest.approx(least, rel=0.03)


def test_labs_of_many_trials_that_agree_show_more_the_more_there_are():
    found = [p_of(*[(0, 20)] * labs, trials=20) for labs in (2, 3, 5)]
    assert found == sorted(found, reverse=True)
    assert found[0] == pytest.approx(0.016, rel=0.03)
    assert found[-1] < 0.002


def test_labs_that_disagree_are_resampled():
    assert p_of((0, 20), (20, 0), trials=20) == 1
    assert p_of((3, 20), (3, 2), (4, 6), trials=20) > 0.05


def test_labs_that_agree_are_tested_by_students_t_as_if_one_trial_less_differed():
    labs = [(0, 20), (2, 8), (4, 12), (1, 9)]
    more = [(other - one) / 20 for one, other in labs]
    wanted = stats.ttest_1samp(more, 1 / 80).pvalue
    assert p_of(*labs, trials=20) == pytest.approx(wanted)


def test_rows_count_what_trials_reached():
    """Models by hand: what is at a limit counts as within it."""
    solved = np.array([[1, 1, 0, 0, 1, 0], [1] * 6], float)
    others = {
        "ended": np.array([[1, 1, 1, 0, 1, -1], [1] * 6], float),
        "pushes": np.array([[3, 25, 25, 60, 26, 60], [7] * 6], float),
        "final_mm": np.array([[1.0, 4.0, 4.5, 30.0, 3.0, 3.8], [0.5] * 6]),
        "decision_s": np.array([[0.1, 0.3, np.nan, 0.2, 0.4, 0.6], [np.nan] * 6]),
    }
    fold = np.full(6, -1, np.int32)
    found, other = trial_rows(measured(solved, fold, has_labs=False, **others))
    assert (found.trials, found.solved, found.success) == (6, 3, 0.5)
    wanted = stats.binomtest(3, 6).proportion_ci(method="wilson")
    assert found.interval == pytest.approx(tuple(wanted))
    assert (found.median_pushes, found.median_decision_s) == (25, 0.3)
    assert found.within_4_mm == pytest.approx(4 / 6)
    assert found.within_25_pushes == pytest.approx(2 / 6)  # of those that are solved
    assert (found.median_final_mm, found.ended_early) == (3.9, 1)
    assert (other.solved, other.median_decision_s, other.ended_early) == (6, None, 0)


def test_one_trial_of_a_lab_has_an_interval():
    solved = np.array([[1.0], [0.0]])
    one, other = trial_rows(measured(solved, np.zeros(1, np.int32)))
    wanted = stats.binomtest(1, 1).proportion_ci(method="wilson")
    assert one.interval == pytest.approx(tuple(wanted))
    assert other.interval == pytest.approx((0.0, 1 - wanted.low))
