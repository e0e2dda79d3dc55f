"""The page of the paper's claims: its studies, and how claims are ruled on."""

from itertools import groupby

from sainet.evaluation.claims import Claim, Verdict, errs_less, solves_more
from sainet.evaluation.rulings import rule_on
from sainet.evaluation.summary import Summary
from sainet.evaluation.trials import TrialRow
from sainet.studies import STUDIES, load_study
from sainet.studies.conclusions import CLAIMS, HEADINGS, PaperClaim, conclude, rows_of
from sainet.studies.evidence import Evidence
from support import REPOSITORY

NOTHING = Summary(models=())


def claim(status, study="a", p=None):
    return PaperClaim("text", "where", study, lambda summary: Verdict(status, p=p))


def test_claims_name_studies_and_those_of_a_study_stand_together():
    named = {each.study for each in CLAIMS} - {""}
    assert named <= set(STUDIES)
    groups = [study for study, _ in groupby(CLAIMS, key=lambda each: each.study)]
    assert len(groups) - groups.count("") == len(named)
    # A claim that nothing tests says why.
    assert all(each.reason for each in CLAIMS if not each.study)
    assert all((each.assumed is not None) == bool(each.study) for each in CLAIMS)


def test_a_study_that_was_not_run_is_never_counted_as_passed():
    for each in conclude(lambda study: None):
        wanted = "not run" if each.claim.study else "not testable here"
        assert each.assumed == wanted
        assert each.true in ("", wanted)


def test_claims_of_one_study_are_corrected_together():
    claims = [claim("holds", "a", 0.03)] + [claim("holds", "a", 0.03)] * 2
    claims.append(claim("holds", "b", 0.03))
    words = [each.assumed for each in conclude(lambda study: NOTHING, claims)]
    assert words == [
        "holds (p 0.03)",
        *["does not hold (p 0.06)"] * 2,
        "holds (p 0.03)",
    ]
    for row in rows_of(conclude(lambda study: NOTHING, claims)):
        assert len(row) == len(HEADINGS)


def test_a_claim_that_a_study_states_has_one_verdict_everywhere():
    evidence = Evidence(REPOSITORY)
    study = load_study("varied-or-fixed")
    ruled = rule_on(study.claims, evidence.summary("varied-or-fixed"))
    (stated,) = (each for each in ruled if each.p is not None)
    wanted = f"{stated.status} (p {stated.p:.2g})"
    claims = [each for each in CLAIMS if each.study == "varied-or-fixed"]
    (found,) = conclude(evidence.find, claims)
    assert found.assumed == wanted
    # Another claim is corrected for the number of both, and changes no ruling.
    added = PaperClaim("text", "where", "varied-or-fixed", errs_less("in", "physics"))
    found, _ = conclude(evidence.find, [*claims, added])
    assert found.assumed == wanted


def test_rules_with_equal_arguments_are_equal():
    assert (
        errs_less("a", "b") == errs_less("a", "b", condition="") != errs_less("b", "a")
    )
    assert solves_more("a", "b", "hard") == solves_more("a", "b", "hard")
    assert solves_more("a", "b", "hard") != solves_more("a", "b", "easy")


def test_a_comparison_of_solved_goals_that_fails_counts_as_tested():
    rows = tuple(
        TrialRow(
            condition="hard",
            model=slug,
            trials=4,
            solved=2,
            success=0.5,
            interval=(0.1, 0.9),
            median_pushes=None,
            median_decision_s=None,
            within_4_mm=0.5,
            within_25_pushes=0.5,
            median_final_mm=None,
            ended_early=0,
        )
        for slug in ("one", "other")
    )
    summary = Summary(models=(), trials=rows)
    fails = Claim("a", solves_more("one", "other", "hard"))
    certain = Claim("b", lambda found: Verdict("holds", p=0.03))
    found = rule_on([certain, certain, fails], summary)
    assert [each.status for each in found] == ["holds", *["does not hold"] * 2]
