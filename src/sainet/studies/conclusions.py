"""The claims of the paper, and what the studies rule on each.

Each claim is tested against engines with assumed and, where there is one, with true
properties. One rule rules on all: a claim holds if every error that it is about is
clearly smaller, corrected as in `evaluation.rulings` together with the claims of its
study. The list was written after most of these studies had been run.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby

from sainet.evaluation.claims import Claim, Rule, errs_less, sign, solves_more
from sainet.evaluation.rulings import Ruled, rule_on
from sainet.evaluation.summary import BASELINE, Summary
from sainet.studies import STUDIES, load_study
from sainet.studies.lab_control import BY_SLOT, HARD, ON_PLYWOOD, SWAPPED, solves_share
from sainet.studies.lab_prediction import IN_TUNED, SAIN_TUNED, TESTS
from sainet.studies.paper_setup import SAIN, SAIN_BULLET, SAIN_TRUE

Find = Callable[[str], Summary | None]  # the summary of a study, if it was run
NOT_RUN, NOT_TESTABLE = "not run", "not testable here"
_BULLET, _PLANAR, _TRUE = (each.slug for each in (SAIN_BULLET, SAIN, SAIN_TRUE))
_TUNED = SAIN_TUNED.slug


@dataclass(frozen=True)
class PaperClaim:
    """A claim of the paper, and the rules that test it.

    Attributes:
        text: the claim.
        source: where the paper states it.
        study: that tests it; empty: none can.
        assumed: the rule, against or around engines with assumed properties.
        true: the same with the true masses and radii.
        reason: why nothing here tests it, or how the test differs from the paper's.
    """

    text: str
    source: str
    study: str = ""
    assumed: Rule | None = None
    true: Rule | None = None
    reason: str = ""


def _of_table(name: str, study: str, disks: str) -> tuple[PaperClaim, ...]:
    return (
        PaperClaim(
            f"SAIN errs less than Physics, {disks}",
            name,
            study,
            errs_less(_BULLET, BASELINE),
            errs_less(_BULLET, "physics-true"),
        ),
        PaperClaim(
            f"SAIN errs less than IN, {disks}",
            name,
            study,
            errs_less(_BULLET, "in"),
            errs_less(_TRUE, "in"),
        ),
    )


_LAB = "in virtual labs, never on a robot"
CLAIMS = (
    *_of_table("Table I", "direct-force-two-disks", "two disks, by a force"),
    *_of_table("Table II", "direct-force-three-disks", "three disks, trained on two"),
    *_of_table("Table III", "robot-two-disks", "two disks, by the robot"),
    PaperClaim(
        "SAIN needs fewer training pushes than IN (less error with 50)",
        "abstract, section I",
        "data-efficiency",
        errs_less(_PLANAR, "in", condition="50"),
    ),
    PaperClaim(
        "IN trained on whole pushes errs less than on single steps",
        "section III-A",
        "recurrent-or-not",
        errs_less("in", "in-single-steps"),
    ),
    PaperClaim(
        "SAIN trained on whole pushes errs less than on single steps",
        "section III-A",
        "recurrent-or-not",
        errs_less(_PLANAR, "sain-single-steps"),
    ),
    PaperClaim(
        "an object-based network errs less than a feedforward network",
        "section II-A",
        "feedforward",
        errs_less(_BULLET, "sain-bullet-whole-state", condition="2 disks"),
    ),
    PaperClaim(
        "SAIN solves more hard goals than IN",
        "figure 3",
        "simulated-control",
        solves_more(_PLANAR, "in", "hard, greedy"),
    ),
    PaperClaim(
        "SAIN solves more hard goals than Physics",
        "abstract",
        "simulated-control",
        solves_more(_PLANAR, BASELINE, "hard, greedy"),
        solves_more(_PLANAR, "physics-true", "hard, greedy"),
    ),
    PaperClaim(
        "fine-tuning on pushes of the robot lowers the errors of SAIN",
        "Table IV",
        "lab-prediction",
        errs_less(_TUNED, _PLANAR, condition=TESTS),
        reason=_LAB,
    ),
    PaperClaim(
        "fine-tuned SAIN errs less than fine-tuned IN",
        "Table IV",
        "lab-prediction",
        errs_less(_TUNED, IN_TUNED.slug, condition=TESTS),
        reason=_LAB,
    ),
    PaperClaim(
        "fine-tuned SAIN errs less than Physics",
        "Table IV",
        "lab-prediction",
        errs_less(_TUNED, BASELINE, condition=TESTS),
        errs_less(_TUNED, "physics-true", condition=TESTS),
        reason=_LAB,
    ),
    PaperClaim(
        "fine-tuned SAIN solves more hard goals than SAIN trained in simulation",
        "figure 4",
        "lab-control",
        solves_more(_TUNED, _PLANAR, HARD),
        reason=_LAB,
    ),
    PaperClaim(
        "fine-tuned SAIN solves 92 % of hard goals on a new surface",
        "figure 5a",
        "lab-new-surface",
        solves_share(_TUNED, 0.92, ON_PLYWOOD),
        reason=_LAB,
    ),
    PaperClaim(
        "fine-tuned SAIN solves 88 % of hard goals with exchanged disks",
        "figure 5b",
        "lab-swapped-disks",
        solves_share(_TUNED, 0.88, SWAPPED),
        reason=_LAB,
    ),
    PaperClaim(
        "the same where the assumed properties do not follow the disks",
        "figure 5b",
        "lab-swapped-disks",
        solves_share(_TUNED, 0.88, BY_SLOT),
        reason=_LAB,
    ),
    PaperClaim(
        "networks trained on varied masses, radii and friction transfer better",
        "section IV-C",
        "varied-or-fixed",
        errs_less(
            _BULLET, "sain-bullet-fixed-properties", condition="varied properties"
        ),
    ),
    PaperClaim(
        "SAIN generalises to objects of other shapes",
        "abstract",
        reason="the engines and networks here predict disks only",
    ),
    PaperClaim(
        "all of this on a physical robot with two disks",
        "section IV-F",
        reason="no recordings of two disks are published, and there is no robot here",
    ),
)


@dataclass(frozen=True)
class Conclusion:
    """A claim of the paper with its rulings: a word, and p where the rule has one."""

    claim: PaperClaim
    assumed: str
    true: str


def conclude(
    find: Find, claims: Sequence[PaperClaim] = CLAIMS
) -> tuple[Conclusion, ...]:
    """Return every claim with its rulings, the claims of a study corrected together.

    A claim that the study itself states has the ruling of the study. The others were
    added later, and are corrected for the number of both.

    Args:
        find: returns the summary of a study; None: the study was not run.
        claims: those of one study stand together.
    """
    found: list[Conclusion] = []
    for study, group in groupby(claims, key=lambda claim: claim.study):
        found += _of_study(list(group), find(study) if study else None)
    return tuple(found)


def _of_study(
    claims: Sequence[PaperClaim], summary: Summary | None
) -> Iterator[Conclusion]:
    if summary is None:
        for claim in claims:
            word = NOT_RUN if claim.study else NOT_TESTABLE
            yield Conclusion(claim, word, word if claim.true else "")
        return
    study = claims[0].study
    own = load_study(study).claims if study in STUDIES else ()
    rules = [rule for c in claims for rule in (c.assumed, c.true) if rule]
    stated = {claim.rule for claim in own}
    added = [Claim(study, rule) for rule in rules if rule not in stated]
    every = (*rule_on([*own, *added], summary)[len(own) :], *rule_on(own, summary))
    words = {ruled.claim.rule: _word(ruled) for ruled in every}
    for claim in claims:
        two = (words[r] if r else "" for r in (claim.assumed, claim.true))
        yield Conclusion(claim, *two)


def _word(ruled: Ruled) -> str:
    """Return the ruling, and p or how many of the errors are clearly different."""
    if ruled.p is not None:
        return f"{ruled.status} (p {ruled.p:.2g})"
    if ruled.status == "holds" or not ruled.comparisons:
        return ruled.status
    signs = [sign(each) for each in ruled.comparisons]
    return (
        f"{ruled.status} ({signs.count(-1)} of {len(signs)} errors clearly smaller, "
        f"{signs.count(1)} clearly larger)"
    )


HEADINGS = (
    *("the paper claims", "where", "assumed properties", "true properties"),
    "study, note",
)


def rows_of(conclusions: Iterable[Conclusion]) -> list[tuple[str, ...]]:
    """Return a row of text for each claim, with the study or the reason behind it."""
    return [
        (
            each.claim.text,
            each.claim.source,
            each.assumed,
            each.true or "–",  # noqa: RUF001
            "; ".join(filter(None, [each.claim.study, each.claim.reason])),
        )
        for each in conclusions
    ]
