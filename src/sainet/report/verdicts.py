"""Sentences below tables: comparisons, and verdicts on which model is better."""

from collections.abc import Iterator, Sequence

from sainet.evaluation.claims import (
    CHANCE,
    TRUE_PROPERTIES,
    Claim,
    Places,
    best_network,
    over_published,
    rank_models,
    sign,
)
from sainet.evaluation.metrics import METRICS
from sainet.evaluation.rulings import rule_on
from sainet.evaluation.summary import BASELINE, Comparison, Summary
from sainet.evaluation.trials import TrialTest
from sainet.report.pages import render_text
from sainet.report.palette import labels_of
from sainet.report.table import DASH


def verdicts_on(summary: Summary) -> tuple[str, ...]:
    """Return the verdicts on a summary.

    Of errors, a sentence for each condition: the best network beside the engine. Of
    trials, which models solved more goals than others; nothing for a single model.
    """
    labels = labels_of(summary.models)
    conditions = [condition.label for condition in summary.conditions]
    if summary.is_of_trials:
        if not (tested := {test.condition for test in summary.tests}):
            return ()
        found = [rank_models(summary, each) for each in conditions if each in tested]
        level = [each.condition or "here" for each in found if not each.better]
        apart = [each for each in found if each.better]
        return (_worded("solved", labels=labels, level=level, apart=apart),)
    best = [best_network(summary, condition) for condition in conditions]
    return tuple(_worded("best", labels=labels, verdict=b) for b in best if b)


def rulings(claims: Sequence[Claim], summary: Summary) -> tuple[str, ...]:
    """Return each claim with its verdict, and the comparisons that contradict it."""
    labels, found = labels_of(summary.models), []
    for ruled in rule_on(claims, summary):
        pairs: dict[tuple[str, str], list[Comparison]] = {}
        for each in ruled.contradicting:
            pairs.setdefault((each.model, each.against), []).append(each)
        wrong = [
            (*pair, _where(e), _where([each for each in e if sign(each)]))
            for pair, e in pairs.items()
        ]
        found.append(_worded("claim", labels=labels, ruled=ruled, wrong=wrong))
    return tuple(found)


def beside_published(summary: Summary) -> str:
    """Return the errors over the published ones."""
    labels, names = labels_of(summary.models), {k: m.name for k, m in METRICS.items()}
    ratios = list(over_published(summary))
    return _worded("ratios", labels=labels, names=names, ratios=ratios)


def comparisons(summary: Summary, shown: set[str]) -> Iterator[str]:
    """Yield by how much each model differs from another, a sentence for each pair."""
    labels = labels_of(summary.models)
    pairs: dict[tuple[str, str, str], dict[str, list[Comparison]]] = {}
    for each in _worth_showing(summary, shown):
        found = pairs.setdefault((each.condition, each.model, each.against), {})
        found.setdefault(each.metric, []).append(each)
    for (condition, model, against), metrics in pairs.items():
        amounts = "; ".join(
            f"{METRICS[key].name} {' / '.join(map(_difference, rows))} "
            f"{METRICS[key].unit}"
            for key, rows in metrics.items()
        )
        where = f"{condition}: " if condition else ""
        yield f"{where}{labels[model]} minus {labels[against]}: {amounts}"


def _worth_showing(summary: Summary, shown: set[str]) -> list[Comparison]:
    """Return the comparisons that a reader needs; the JSON contains all.

    Beside true-property physics a comparison with physics adds little, and the end of
    a push repeats its mean; where nothing else was compared, these are kept. A model
    that abstains predicts like another one, which has a comparison of its own.
    """
    hidden = {model.slug for model in summary.models if model.abstains}
    hidden |= {TRUE_PROPERTIES} - shown
    every = [e for e in summary.comparisons if not hidden & {e.model, e.against}]
    less = BASELINE if TRUE_PROPERTIES in shown else ""
    steps = [each for each in every if not METRICS[each.metric].is_of_end]
    return [each for each in steps if each.against != less] or steps or every


def _difference(comparison: Comparison) -> str:
    low, high = comparison.difference.low, comparison.difference.high
    interval = f" [{_signed(low)}, {_signed(high)}]" if low is not None else ""
    return _signed(comparison.difference.value) + interval


def _signed(value: float | None) -> str:
    return DASH if value is None else f"{value:+.3f}".replace("-", "−")  # noqa: RUF001


def trial_sentences(summary: Summary) -> Iterator[str]:
    """Yield trials that noise ended early, and goals that one of two models reached."""
    labels = labels_of(summary.models)
    for row in summary.trials:
        if row.ended_early:
            yield (
                f"{row.condition}, {labels[row.model]}: {row.ended_early} of "
                f"{row.trials - row.solved} unsolved trials ended because the measured "
                "pose was within the tolerance"
            )
    p = "p over labs" if summary.differences else "exact McNemar p"
    for test in filter(_is_reported, summary.tests):
        yield (
            f"{test.condition}, {test.measure.replace('_', ' ')}: "
            f"only {labels[test.model]} {test.only_one}, "
            f"only {labels[test.against]} {test.only_other} "
            f"({p} = {test.p:.2g})"
        )
    for each in summary.differences:
        found = each.difference
        yield (
            f"{each.condition}, {each.measure.replace('_', ' ')}: "
            f"{labels[each.model]} minus {labels[each.against]} {_signed(found.value)} "
            f"[{_signed(found.low)}, {_signed(found.high)}]"
        )


def _is_reported(test: TrialTest) -> bool:
    """Report every difference in success; of other measures, those with a small p."""
    if test.measure == "solved":
        return bool(test.only_one or test.only_other)
    return test.p < CHANCE


def worded_places(found: Places, summary: Summary) -> str:
    """Return in which errors a model is better or worse than another."""
    labels = labels_of(summary.models)
    return _worded(
        "places",
        labels=labels,
        places=found,
        better=_where(found.better),
        worse=_where(found.worse),
    )


def _where(found: Sequence[Comparison]) -> str:
    """Return errors and disks: "pos of disks 1, 2 and 3, rot of disk 1"."""
    bodies: dict[str, list[str]] = {}
    for each in found:
        bodies.setdefault(METRICS[each.metric].name, []).append(str(each.body))
    return ", ".join(
        f"{name} of disk{'s' * (len(disks) > 1)} {_listed(disks)}"
        for name, disks in bodies.items()
    )


def _listed(words: Sequence[str]) -> str:
    *first, last = words
    return f"{', '.join(first)} and {last}" if first else last


def _worded(kind: str, **values: object) -> str:
    return render_text("verdicts.j2", kind=kind, **values)
