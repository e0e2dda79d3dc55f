"""Claims that a model errs at most a little more than another."""

import pytest

from report import samples
from sainet.evaluation.intervals import Estimate
from sainet.evaluation.margins import errs_at_most_more
from sainet.evaluation.summary import Comparison


def ruled(*differences, margin=0.05, less=0.0):
    """Rule on SAIN beside an IN that errs by 2 mm on every disk."""
    bodies = range(1, len(differences) + 1)
    rows = [samples.row("in", body, 2.0 / 3.6) for body in bodies]
    pairs = [
        Comparison(
            condition="",
            model="sain",
            against="in",
            body=body,
            metric="pos_mm",
            difference=Estimate(low, low, high),
        )
        for body, (low, high) in enumerate(differences, start=1)
    ]
    rule = errs_at_most_more("sain", "in", margin, metrics=("pos_mm",), less=less)
    return rule(samples.summary(rows, comparisons=tuple(pairs)))


@pytest.mark.parametrize(
    ("high", "status"), [(0.09, "holds"), (0.11, "does not hold"), (-0.2, "holds")]
)
def test_the_upper_bound_decides_not_the_mean(high, status):
    found = ruled((-0.3, high), (-1.0, -0.5))
    assert found.status == status
    assert [each.body for each in found.contradicting] == [1] * (high > 0.1)


def test_a_fraction_must_be_clearly_better():
    differences = (-0.3, -0.1), (-0.1, 0.05)
    assert ruled(*differences, less=0.5).status == "holds"
    assert ruled(*differences, less=0.6).status == "does not hold"


def test_without_comparisons_nothing_is_ruled():
    assert ruled().status == "not testable here"


def test_a_comparison_without_an_interval_is_not_ruled_on():
    assert ruled((-0.3, -0.1), (-0.3, None)).status == "not testable here"
