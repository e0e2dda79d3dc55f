"""Claims about summaries, and the verdicts on them. Wording is left to the report."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

from sainet.evaluation.summary import BASELINE, Comparison, Factor, Summary
from sainet.evaluation.trials import TrialRow, TrialTest
from sainet.models.identity import ModelId

Status = Literal["holds", "does not hold", "not testable here"]
CHANCE = 0.05  # p below which trials differ
LEVEL = 1e-3  # relative difference below which two errors are the same


@dataclass(frozen=True)
class Verdict:
    """The ruling on a claim, and the comparisons that it rests on."""

    status: Status
    comparisons: tuple[Comparison, ...] = ()
    tests: tuple[TrialTest, ...] = ()


@dataclass(frozen=True)
class Claim:
    """A sentence that is true or false, and the rule that decides."""

    text: str
    rule: Callable[[Summary], Verdict]


def errs_less(
    model: str, against: str, metrics: Sequence[str], *, condition: str = ""
) -> Callable[[Summary], Verdict]:
    """Return the rule that a model errs less: every interval lies below zero."""
    return _all(model, against, metrics, condition, lambda each: _sign(each) < 0)


def does_not_err_more(
    model: str, against: str, metrics: Sequence[str], *, condition: str = ""
) -> Callable[[Summary], Verdict]:
    """Return the rule that a model does not err more: no interval lies above zero."""
    return _all(model, against, metrics, condition, lambda each: _sign(each) <= 0)


def solves_alike(condition: str) -> Callable[[Summary], Verdict]:
    """Return the rule that no two models differ in the goals that they solve."""

    def rule(summary: Summary) -> Verdict:
        tests = _tests_of_solved(summary, condition)
        if not tests:
            return Verdict("not testable here")
        alike = all(test.p >= CHANCE for test in tests)
        return Verdict("holds" if alike else "does not hold", tests=tests)

    return rule


def _all(
    model: str,
    against: str,
    metrics: Sequence[str],
    condition: str,
    test: Callable[[Comparison], bool],
) -> Callable[[Summary], Verdict]:
    def rule(summary: Summary) -> Verdict:
        found = tuple(
            each
            for each in compared(summary, model, against, condition)
            if each.metric in metrics
        )
        if not found or any(each.difference.low is None for each in found):
            return Verdict("not testable here", found)
        return Verdict("holds" if all(map(test, found)) else "does not hold", found)

    return rule


def compared(
    summary: Summary, model: str, against: str, condition: str
) -> Iterator[Comparison]:
    """Yield the comparisons of a model with another, in the direction asked for."""
    for each in summary.comparisons:
        names = each.condition, each.model, each.against
        if names == (condition, model, against):
            yield each


def _sign(comparison: Comparison) -> int:
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
    found = [e for e in compared(summary, model, against, condition)]
    found = [each for each in found if each.metric in metrics]
    better = tuple(each for each in found if _sign(each) < 0)
    worse = tuple(each for each in found if _sign(each) > 0)
    return Places(model, against, better, worse)


@dataclass(frozen=True)
class Comparative:
    """The best network of a condition beside the physics engine."""

    condition: str
    unit: str
    best: Factor
    true_properties: Factor | None  # of the engine with true masses and radii
    alone: Factor | None  # of the network without an engine
    is_network: bool


def best_network(summary: Summary, condition: str) -> Comparative | None:
    """Return the best model of a condition that is not the engine as it is."""
    factors = [each for each in summary.factors if each.condition == condition]
    ids = {model.slug: model for model in summary.models}
    by_model = {each.model: each for each in factors}
    networks = [
        each for each in factors if ids[each.model].kind not in ("physics", "published")
    ]
    hybrids = [each for each in networks if ids[each.model].kind == "sain"]
    true = by_model.get("physics-true")
    if true is not None and abs(true.error - true.baseline) < LEVEL * true.baseline:
        true = None  # true masses and radii make no difference here
    rivals = hybrids or networks or ([true] if true else [])
    others = rivals or [each for each in factors if _is_other(each, ids)]
    if not others:
        return None
    best = min(others, key=lambda each: each.error)
    is_network = bool(networks)
    return Comparative(
        condition=condition,
        unit="mm",
        best=best,
        true_properties=true if is_network else None,
        alone=by_model.get("in") if hybrids else None,
        is_network=is_network,
    )


def _is_other(factor: Factor, ids: dict[str, ModelId]) -> bool:
    return factor.model not in (BASELINE, "physics-true") and (
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
