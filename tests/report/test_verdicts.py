"""Verdicts on control trials: which models solve more goals, and by how much."""

from sainet.evaluation.conditions import Condition
from sainet.evaluation.summary import Summary
from sainet.evaluation.trials import TrialRow, TrialTest
from sainet.models.identity import ModelId
from sainet.report.verdicts import verdicts_on

MODELS = {"physics": 16, "in": 2, "sain": 7}


def row(condition, model, solved, trials=50):
    return TrialRow(
        condition=condition,
        model=model,
        trials=trials,
        solved=solved,
        success=solved / trials,
        interval=(0.0, 1.0),
        median_pushes=None,
        median_decision_s=None,
        within_4_mm=0.0,
        within_25_pushes=0.0,
        median_final_mm=None,
        ended_early=0,
    )


def paired(condition, model, against, p):
    return TrialTest(
        condition=condition,
        measure="solved",
        model=model,
        against=against,
        only_one=3,
        only_other=14,
        p=p,
    )


def summary(tests, conditions=("three disks",), models=tuple(MODELS)):
    return Summary(
        models=tuple(ModelId(kind=model) for model in models),
        conditions=tuple(Condition(label=label) for label in conditions),
        trials=tuple(row(c, m, MODELS[m]) for c in conditions for m in models),
        tests=tuple(tests),
    )


def test_models_that_solve_more_are_named_with_their_numbers():
    tests = [
        paired("three disks", "in", "physics", 0.001),
        paired("three disks", "sain", "physics", 0.04),
        paired("three disks", "in", "sain", 0.2),
        paired("easy", "in", "physics", 0.05),
    ]
    (verdict,) = verdicts_on(summary(tests, ("easy", "three disks")))
    assert verdict == (
        "No two models differ in the goals that they solve (p < 0.05) in: easy. three "
        "disks: Physics solves 16 of 50 goals, more than SAIN (7) and IN (2)."
    )


def test_one_model_has_no_verdict():
    assert verdicts_on(summary([], models=("sain",))) == ()
