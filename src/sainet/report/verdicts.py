"""Verdicts in words: which model is better than which, and by how much."""

from collections.abc import Sequence

from sainet.evaluation.claims import (
    PUBLISHED_ORDER,
    Claim,
    Places,
    best_network,
    over_published,
    rank_models,
    sign,
)
from sainet.evaluation.metrics import METRICS
from sainet.evaluation.summary import Comparison, Summary
from sainet.report.pages.templates import render_text
from sainet.report.palette import labels_of


def verdicts_on(summary: Summary) -> tuple[str, ...]:
    """Return what a reader should take from a table.

    Of errors, a sentence for each condition: the best network beside the engine. Of
    trials, which models solved more goals than others; nothing for a single model.
    """
    labels = labels_of(summary.models)
    conditions = [condition.label for condition in summary.conditions]
    if summary.is_of_trials:
        if not summary.tests:
            return ()
        found = [rank_models(summary, condition) for condition in conditions]
        level = [each.condition or "here" for each in found if not each.better]
        apart = [each for each in found if each.better]
        return (_worded("solved", labels=labels, level=level, apart=apart),)
    best = [best_network(summary, condition) for condition in conditions]
    return tuple(_worded("best", labels=labels, verdict=b) for b in best if b)


def rulings(claims: Sequence[Claim], summary: Summary) -> tuple[str, ...]:
    """Return each claim with its verdict, and the comparisons that contradict it."""
    labels, found = labels_of(summary.models), []
    for claim in claims:
        verdict = claim.rule(summary)
        pairs: dict[tuple[str, str], list[Comparison]] = {}
        for each in verdict.contradicting:
            pairs.setdefault((each.model, each.against), []).append(each)
        wrong = [
            (*pair, _where(e), _where([each for each in e if sign(each)]))
            for pair, e in pairs.items()
        ]
        text = {"labels": labels, "claim": claim, "wrong": wrong}
        found.append(_worded("claim", status=verdict.status, **text))
    return tuple(found)


def beside_published(summary: Summary) -> str:
    """Return whether the published order of errors holds, and errors over published."""
    (ruling,) = rulings([PUBLISHED_ORDER], summary)
    labels, names = labels_of(summary.models), {k: m.name for k, m in METRICS.items()}
    ratios = list(over_published(summary))
    return f"{ruling} " + _worded("ratios", labels=labels, names=names, ratios=ratios)


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
