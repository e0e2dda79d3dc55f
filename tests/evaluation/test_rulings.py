"""Rulings on several claims: Holm's correction, and p beside intervals."""

from functools import partial
from itertools import combinations

import numpy as np
import pytest
from scipy import stats

from sainet.evaluation.claims import Claim, Verdict
from sainet.evaluation.intervals import Sample
from sainet.evaluation.rulings import holm, rule_on
from sainet.evaluation.summary import Comparison, Estimate, Summary

NOTHING = Summary(models=())
SEEN = Comparison(
    condition="", model="a", against="b", body=1, metric="pos_mm", difference=Estimate()
)


def claim(status, p=None, *, tested=True):
    verdict = Verdict(status, (SEEN,) if tested else (), (), p)
    return Claim("a claim", lambda summary: verdict)


@pytest.mark.parametrize("seed", range(10))
def test_corrected_p_is_that_of_all_bonferroni_tests_together(seed):
    rng = np.random.default_rng(seed)
    values, others = rng.uniform(0, 0.2, rng.integers(1, 5)), int(rng.integers(0, 3))
    every = [*values, *[1.0] * others]  # closed testing (Marcus et al., 1976)
    subsets = [
        chosen
        for size in range(1, len(every) + 1)
        for chosen in combinations(range(len(every)), size)
    ]
    wanted = [
        max(
            min(len(chosen) * min(every[j] for j in chosen), 1.0)
            for chosen in subsets
            if i in chosen
        )
        for i in range(len(values))
    ]
    np.testing.assert_allclose(holm(list(values), len(every)), wanted)


def test_the_primary_claim_is_not_corrected_and_the_others_are():
    claims = [claim("holds", 0.04), claim("holds", 0.02), claim("holds", 0.03)]
    first, second, third = rule_on(claims, NOTHING)
    assert (first.status, first.p, first.is_primary) == ("holds", 0.04, True)
    assert (second.status, second.p) == ("holds", 0.04)
    assert (third.status, third.p) == ("holds", 0.04)
    more = [*claims, claim("does not hold"), claim("not testable here", tested=False)]
    statuses = [each.status for each in rule_on(more, NOTHING)]
    # Three were tested beside the primary one: 0.02 times 3 is more than 0.05.
    assert statuses == [
        "holds",
        *["does not hold"] * 3,
        "not testable here",
    ]


def test_a_claim_without_p_keeps_its_verdict():
    claims = [claim("holds", 0.001), claim("holds"), claim("does not hold")]
    found = rule_on(claims, NOTHING)
    assert [each.status for each in found] == ["holds", "holds", "does not hold"]
    assert found[1].p is None


def test_a_bound_that_no_chance_decides_does_not_count():
    claims = [claim("holds", 0.04), claim("holds", 0.02), claim("holds", 0.03)]
    bound = Claim("a bound", lambda summary: Verdict("holds", (SEEN,), is_test=False))
    found = rule_on([*claims, bound], NOTHING)
    assert found[:3] == rule_on(claims, NOTHING)
    assert found[3].status == "holds"


@pytest.mark.parametrize("shift", [0.0, 0.1, 0.25])
def test_p_of_a_paired_difference_is_that_of_the_t_test(shift):
    rng = np.random.default_rng(1)
    draw = partial(rng.normal, size=(400, 1))
    base = draw()
    one, other = base + draw() + shift, base + draw()
    found = Sample(one).chance(Sample(other))
    wanted = stats.ttest_rel(one, other).pvalue
    assert found[0] == pytest.approx(wanted[0], abs=0.03)
    _, low, high = Sample(one).minus(Sample(other))
    assert (found[0] < 0.05) == (low[0] > 0 or high[0] < 0)
