"""Which model to use, from a cross-validation: the rule, stated beforehand.

The engine as it is comes first, then the identified engine, then learned models, from
the simplest. Each replaces the choice so far if it is better: in every division into
folds, an error at the end of pushes has a paired difference whose 95 % interval lies
below zero, and none has one above zero.
"""

from collections.abc import Sequence

import msgspec

from sainet.evaluation.claims import compared, sign
from sainet.evaluation.intervals import Estimate
from sainet.evaluation.summary import Comparison, Summary

ENDS = ("final_pos_mm", "final_rot_deg")


class Gain(msgspec.Struct, frozen=True, kw_only=True):
    """Errors of the recommended model and of another one, in one division."""

    condition: str
    against: str  # slug
    metric: str
    error: tuple[float, ...]  # by disk (mm or degrees)
    error_against: tuple[float, ...]
    difference: tuple[Estimate, ...]  # paired, recommended minus other, by disk


class Recommendation(msgspec.Struct, frozen=True, kw_only=True):
    """The model to use, and how much less it errs than others."""

    model: str  # slug
    gains: tuple[Gain, ...]  # over the engine as it is, and over the identified one


def recommend(
    summary: Summary, order: Sequence[str], conditions: Sequence[str]
) -> Recommendation:
    """Return the model to use.

    Args:
        summary: of a cross-validation; all models are compared with each other.
        order: slugs of the models, from the simplest.
        conditions: the divisions into folds in which a model must be better.
    """
    chosen = order[0]
    for slug in order[1:]:
        if all(_is_better(summary, slug, chosen, label) for label in conditions):
            chosen = slug
    others = [slug for slug in order[:2] if slug != chosen]
    gains = tuple(
        _gain(summary, (chosen, other), metric, label)
        for label in conditions
        for other in others
        for metric in ENDS
    )
    return Recommendation(model=chosen, gains=gains)


def _is_better(summary: Summary, model: str, against: str, condition: str) -> bool:
    found = _ends(summary, model, against, condition)
    signs = [sign(each) for each in found]
    return bool(found) and min(signs) < 0 and max(signs) <= 0


def _ends(
    summary: Summary, model: str, against: str, condition: str
) -> list[Comparison]:
    pairs = compared(summary, model, against, condition)
    return [each for each in pairs if each.metric in ENDS]


def _gain(
    summary: Summary, models: tuple[str, str], metric: str, condition: str
) -> Gain:
    found = _ends(summary, *models, condition)
    ours, theirs = (summary.errors(slug, metric, condition) for slug in models)
    return Gain(
        condition=condition,
        against=models[1],
        metric=metric,
        error=tuple(ours),
        error_against=tuple(theirs),
        difference=tuple(e.difference for e in found if e.metric == metric),
    )
