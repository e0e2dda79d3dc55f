"""Paired tests of trials: exact ones of single trials, and those over labs."""

import numpy as np
import pytest
import xarray as xr

from sainet.evaluation.measurements import Header, Measurements
from sainet.evaluation.trials import compare_trials
from sainet.models.identity import ModelId


def p_of(*labs: tuple[int, int], trials: int) -> float:
    """p of two models: how many trials each solved in each lab, of as many."""
    order = np.arange(trials)
    solved = np.array(
        [[order < few for few in model] for model in zip(*labs, strict=True)]
    )
    solved = solved.reshape(2, -1).astype(float)
    trial = ("model", "sample")
    names = ("solved", "ended", "pushes", "final_mm")
    data = xr.Dataset({name: (trial, solved) for name in names})
    samples = np.arange(solved.shape[1], dtype=np.int32)
    data = data.assign_coords(
        condition=("sample", 0 * samples),
        fold=("sample", samples // trials),
        row=("sample", samples),
    )
    models = (ModelId(kind="physics"), ModelId(kind="in"))
    found = Measurements(data, Header(models=models, has_labs=True))
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
