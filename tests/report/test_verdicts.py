"""Verdicts: which models solve more goals, and whether errors rank as published."""

import pytest
from msgspec.structs import replace

from report import samples
from sainet.evaluation.claims import (
    PUBLISHED_ORDER,
    best_network,
    errs_less,
    sign,
    solves_more,
)
from sainet.evaluation.measurements import Condition, PublishedValues
from sainet.evaluation.summary import Comparison, Estimate, Summary
from sainet.evaluation.trials import TrialRow, TrialTest
from sainet.models.identity import ModelId
from sainet.report.verdicts import beside_published, rulings, verdicts_on

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
    # The trials of one model alone, those with obstacles, have no test.
    (verdict,) = verdicts_on(summary(tests, ("easy", "three disks", "obstacles")))
    assert verdict == (
        "No two models differ in the goals that they solve (p < 0.05) in: easy. three "
        "disks: Physics solves 16 of 50 goals, more than SAIN (7) and IN (2)."
    )


def test_one_model_has_no_verdict():
    assert verdicts_on(summary([], models=("sain",))) == ()


PAPER = {"physics": (6.0, 4.0), "in": (5.0, 3.0), "sain": (4.0, 2.0)}


def tables(pairs, models=("physics", "in", "sain-bullet")):
    """Return errors of models, compared as `pairs` give: difference by both slugs."""
    errors = dict(zip(models, (3.0, 1.5, 1.0), strict=True))
    rows = [
        samples.row(model, body, error / 3.6)
        for model, error in errors.items()
        for body in (1, 2)
    ]
    published = tuple(
        PublishedValues(
            condition="", model=samples.identity(model), values={"pos_mm": means}
        )
        for model, means in PAPER.items()
    )
    comparisons = tuple(samples.compared(*pair, value) for pair, value in pairs)
    return samples.summary(rows, published=published, comparisons=comparisons)


@pytest.mark.parametrize(
    ("difference", "words"),
    [
        (-0.2, "Verdict: holds."),
        (0.02, "SAIN around Bullet does not err less than IN in pos of disk 1 (not "),
        (0.2, "SAIN around Bullet does not err less than IN in pos of disk 1 (clearly"),
    ],
)
@pytest.mark.parametrize("is_turned", [False, True])
def test_errors_rank_as_published_or_the_exceptions_are_named(
    difference, words, is_turned
):
    last = ("sain-bullet", "in"), difference
    if is_turned:
        last = ("in", "sain-bullet"), -difference
    found = tables([(("in", "physics"), -1.0), last])
    (ruling,) = rulings([PUBLISHED_ORDER], found)
    assert words in ruling
    status = "holds" if difference < 0 else "does not hold"
    verdict = PUBLISHED_ORDER.rule(found)
    assert (verdict.status, len(verdict.comparisons)) == (status, 2)
    assert "Physics pos 0.50 / 0.75; IN pos 0.30 / 0.50; " in beside_published(found)


def test_without_published_errors_their_order_is_not_testable():
    assert PUBLISHED_ORDER.rule(samples.summary([])).status == "not testable here"


def compared_by(low, high):
    """A summary of SAIN compared with IN, by intervals with these ends."""
    names = {"model": "sain", "against": "in", "condition": "", "body": 1}
    difference = Estimate((low + high) / 2, low, high)
    found = [
        Comparison(**names, metric=metric, difference=difference)
        for metric in ("pos_mm", "rot_deg")
    ]
    return Summary(models=(), comparisons=tuple(found))


@pytest.mark.parametrize(
    ("ends", "status", "reverse"),
    [
        ((-2.0, -1.0), "holds", "does not hold"),
        ((1.0, 2.0), "does not hold", "holds"),
        ((-1.0, 1.0), "does not hold", "does not hold"),
    ],
)
def test_a_model_errs_less_if_every_interval_lies_below_zero(ends, status, reverse):
    found = compared_by(*ends)
    assert errs_less("sain", "in")(found).status == status
    assert errs_less("in", "sain")(found).status == reverse
    assert errs_less("sain", "physics")(found).status == "not testable here"


def test_the_least_certain_comparison_decides_that_a_model_errs_less():
    pairs = compared_by(-2.0, -1.0).comparisons
    values = [replace(each, p=p) for each, p in zip(pairs, (0.01, 0.04), strict=True)]
    found = errs_less("sain", "in")(Summary(models=(), comparisons=tuple(values)))
    assert (found.status, found.p) == ("holds", 0.04)


def test_a_comparison_without_an_interval_leaves_a_claim_untested():
    first, last = compared_by(-2.0, -1.0).comparisons
    last = replace(last, difference=Estimate(-1.5))
    found = Summary(models=(), comparisons=(first, last))
    assert errs_less("sain", "in")(found).status == "not testable here"
    assert sign(replace(last, difference=Estimate(-1.5, None, -1.0))) == 0


@pytest.mark.parametrize(("low", "high"), [(0.0, 0.0), (0.0, 1.0), (-1.0, 0.0)])
def test_an_interval_that_ends_at_zero_does_not_leave_it_out(low, high):
    assert [sign(each) for each in compared_by(low, high).comparisons] == [0, 0]


def best_of(**errors):
    """Rule on models with these errors in mm; the engine as it is errs by 3.6 mm."""
    known = {name.replace("_", "-").strip("-"): e for name, e in errors.items()}
    factors = tuple(samples.factor(*each) for each in known.items())
    models = tuple(map(samples.identity, known))
    found = best_network(Summary(models=models, factors=factors), "")
    assert found is not None
    return found


@pytest.mark.parametrize("sain", [0.5, 1.5])
def test_the_best_network_adds_to_an_engine_where_one_does(sain):
    found = best_of(physics=3.6, physics_true=2.0, in_=1.0, sain=sain)
    assert found.best.model == "sain"
    assert (found.alone.error, found.true_properties.error) == (1.0, 2.0)


def test_true_properties_that_change_nothing_are_left_out():
    assert best_of(physics=3.6, physics_true=3.601, sain=0.5).true_properties is None


@pytest.mark.parametrize(("p", "status"), [(0.001, "holds"), (0.2, "does not hold")])
def test_a_model_solves_more_if_chance_is_an_unlikely_reason(p, status):
    found = summary([paired("three disks", "in", "physics", p)])
    assert solves_more("physics", "in", "three disks")(found).status == status
    assert solves_more("in", "physics", "three disks")(found).status == "does not hold"
    assert solves_more("in", "gp", "three disks")(found).status == "not testable here"
