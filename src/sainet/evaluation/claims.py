"""Claims about summaries, and the verdicts on them. Wording is left to the report."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from typing import Literal

from msgspec.structs import astuple, replace

from sainet.evaluation.metrics import MEASURED
from sainet.evaluation.summary import BASELINE, Comparison, Estimate, Factor, Summary
from sainet.evaluation.trials import TrialRow, TrialTest
from sainet.models.identity import ModelId

Status = Literal["holds", "does not hold", "not testable here"]
CHANCE = 0.05  # p below which trials differ
TRUE_PROPERTIES = "physics-true"
LEVEL = 1e-3  # relative difference below which two errors are the same


@dataclass(frozen=True)
class Verdict:
    """The ruling on a claim."""

    status: Status
    comparisons: tuple[Comparison, ...] = ()  # all that the verdict rests on
    contradicting: tuple[Comparison, ...] = ()  # those that contradict the claim
    p: float | None = None  # two-sided, that chance makes the claim hold, if known
    # Whether chance can make the claim hold: then it counts where others are corrected.
    is_test: bool = True


Rule = Callable[[Summary], Verdict]


@dataclass(frozen=True)
class Claim:
    """A sentence that is true or false, and the rule that decides."""

    text: str
    rule: Rule
    margin: float = 0.0  # by which a model may err more, as a fraction


def keeps_published_order(summary: Summary) -> Verdict:
    """Return whether mean errors rank the models as the published means do.

    Each error of each disk is ranked on its own. A comparison contradicts the order if
    the model that errs less in the publication does not err less here, clearly or not.
    """
    found: list[Comparison] = []
    for metric in MEASURED:
        known = [each for each in summary.published if metric in each.values]
        errors = {our_model(each.model, summary): each.values[metric] for each in known}
        for body in range(min(map(len, errors.values()), default=0)):
            places = {slug: values[body] for slug, values in errors.items()}
            ranked = sorted(
                (error, slug) for slug, error in places.items() if error is not None
            )
            for (_, less), (_, more) in pairwise(ranked):
                pairs = compared(summary, less, more, "")
                found += [e for e in pairs if (e.metric, e.body) == (metric, body + 1)]
    wrong = tuple(each for each in found if (each.difference.value or 0) >= 0)
    if not found:
        return Verdict("not testable here")
    return Verdict("does not hold" if wrong else "holds", tuple(found), wrong)


PUBLISHED_ORDER = Claim(
    "mean errors rank as in the paper, SAIN below IN below Physics",
    keeps_published_order,
)


def errs_less(
    model: str,
    against: str,
    *,
    condition: str = "",
    metrics: Sequence[str] = ("pos_mm", "rot_deg"),
) -> Rule:
    """Return the rule that a model errs less: every interval lies below zero."""
    return _errs_less(model, against, condition, tuple(metrics))


@cache  # of equal arguments one rule: a test that two claims ask for is one test
def _errs_less(
    model: str, against: str, condition: str, metrics: tuple[str, ...]
) -> Rule:
    def rule(summary: Summary) -> Verdict:
        pairs = compared(summary, model, against, condition)
        found = tuple(each for each in pairs if each.metric in metrics)
        if not found or any(each.difference.low is None for each in found):
            return Verdict("not testable here", found)
        wrong = tuple(each for each in found if sign(each) >= 0)
        # All must hold: the least certain one decides (an intersection-union test).
        known = [each.p for each in found if each.p is not None]
        p = max(known) if not wrong and len(known) == len(found) else None
        return Verdict("does not hold" if wrong else "holds", found, wrong, p)

    return rule


@cache
def solves_more(model: str, against: str, condition: str) -> Rule:
    """Return the rule that a model solves more goals, by more than chance."""

    def rule(summary: Summary) -> Verdict:
        rows = [each for each in summary.trials if each.condition == condition]
        if not {model, against} <= {row.model for row in rows}:
            return Verdict("not testable here")
        found = rank_models(summary, condition).better
        better = {row.model: others for row, others in found}
        if against not in (row.model for row in better.get(model, ())):
            return Verdict("does not hold")
        (p,) = (
            test.p
            for test in _tests_of_solved(summary, condition)
            if {test.model, test.against} == {model, against}
        )
        return Verdict("holds", p=p)

    return rule


def our_model(published: ModelId, summary: Summary) -> str:
    """Return the slug of our model that corresponds to a published one.

    The internal engine of the paper's SAIN is Bullet. A summary without such a model
    has SAIN around another engine.
    """
    around = [
        each.slug
        for each in summary.models
        if each.simulator is not None and each.simulator.engine == "bullet"
        if each == replace(published, simulator=each.simulator)
    ]
    return around[0] if published.kind == "sain" and around else published.slug


def over_published(
    summary: Summary,
) -> Iterator[tuple[str, dict[str, tuple[float, ...]]]]:
    """Yield models with their errors over the published ones, by metric, by disk."""
    for each in summary.published:
        slug = our_model(each.model, summary)
        errors = {
            metric: summary.errors(slug, metric, each.condition)
            for metric in MEASURED
            if metric in each.values
        }
        yield (
            slug,
            {
                metric: tuple(
                    ours / theirs
                    for ours, theirs in zip(values, each.values[metric], strict=True)
                    if theirs
                )
                for metric, values in errors.items()
                if values
            },
        )


def compared(
    summary: Summary, model: str, against: str, condition: str
) -> Iterator[Comparison]:
    """Yield the comparisons of a model with another, in the direction asked for."""
    for each in summary.comparisons:
        names = each.condition, each.model, each.against
        if names == (condition, model, against):
            yield each
        if names == (condition, against, model):
            value, high, low = (
                None if number is None else -number
                for number in astuple(each.difference)
            )
            turned = Estimate(value, low, high)
            yield replace(each, model=model, against=against, difference=turned)


def sign(comparison: Comparison) -> int:
    """Return -1 or 1 where the interval lies below or above zero, else 0."""
    low, high = comparison.difference.low, comparison.difference.high
    if low is None or high is None:
        return 0
    return int(low > 0) - int(high < 0)


@dataclass(frozen=True)
class Places:
    """The errors in which one model is better or worse than another."""

    model: str
    against: str
    better: tuple[Comparison, ...]
    worse: tuple[Comparison, ...]


def places(
    summary: Summary,
    model: str,
    against: str,
    *,
    metrics: Sequence[str],
    condition: str = "",
) -> Places:
    """Return where the interval of the paired difference leaves out zero."""
    pairs = compared(summary, model, against, condition)
    found = [each for each in pairs if each.metric in metrics]
    better = tuple(each for each in found if sign(each) < 0)
    worse = tuple(each for each in found if sign(each) > 0)
    return Places(model, against, better, worse)


@dataclass(frozen=True)
class Comparative:
    """The best network of a condition beside the physics engine."""

    condition: str
    best: Factor
    true_properties: Factor | None  # of the engine with true masses and radii
    alone: Factor | None  # of the network without an engine


def best_network(summary: Summary, condition: str) -> Comparative | None:
    """Return the best model of a condition that is not the engine as it is."""
    ids = {model.slug: model for model in summary.models}
    factors = [
        each
        for each in summary.factors
        if each.condition == condition and not ids[each.model].abstains
    ]
    by_model = {each.model: each for each in factors}
    networks = [
        each for each in factors if ids[each.model].kind not in ("physics", "published")
    ]
    hybrids = [each for each in networks if ids[each.model].kind == "sain"]
    true = by_model.get(TRUE_PROPERTIES)
    if true is not None and abs(true.error - true.baseline) < LEVEL * true.baseline:
        true = None  # true masses and radii make no difference here
    rivals = hybrids or networks or ([true] if true else [])
    others = rivals or [each for each in factors if _is_other(each, ids)]
    if not others:
        return None
    best = min(others, key=lambda each: each.error)
    return Comparative(
        condition=condition,
        best=best,
        true_properties=true if networks else None,
        alone=by_model.get("in") if hybrids else None,
    )


def _is_other(factor: Factor, ids: dict[str, ModelId]) -> bool:
    return factor.model not in (BASELINE, TRUE_PROPERTIES) and (
        ids[factor.model].kind != "published" or bool(ids[factor.model].name)
    )


@dataclass(frozen=True)
class Ranking:
    """The goals that models solved in one condition, where chance cannot explain it.

    Attributes:
        condition: label of the condition.
        better: each model that solved more goals than others, with these others.
    """

    condition: str
    better: tuple[tuple[TrialRow, tuple[TrialRow, ...]], ...]


def rank_models(summary: Summary, condition: str) -> Ranking:
    """Return which models solved more goals than which by more than chance."""
    rows = {row.model: row for row in summary.trials if row.condition == condition}
    worse: dict[str, list[TrialRow]] = {slug: [] for slug in rows}
    for test in _tests_of_solved(summary, condition):
        if test.p < CHANCE:
            pair = test.model, test.against
            more, fewer = pair if test.only_one > test.only_other else pair[::-1]
            worse[more].append(rows[fewer])
    found = [
        (rows[slug], tuple(sorted(others, key=lambda row: -row.solved)))
        for slug, others in worse.items()
        if others
    ]
    found.sort(key=lambda each: -each[0].solved)
    return Ranking(condition, tuple(found))


def _tests_of_solved(summary: Summary, condition: str) -> tuple[TrialTest, ...]:
    return tuple(
        test
        for test in summary.tests
        if test.condition == condition and test.measure == "solved"
    )
