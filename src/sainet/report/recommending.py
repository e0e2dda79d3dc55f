"""The verdict of a cross-validation in words."""

from collections.abc import Iterator, Sequence

from sainet.evaluation.intervals import Estimate
from sainet.evaluation.recommendation import ENDS, Gain, Recommendation
from sainet.evaluation.summary import Summary
from sainet.report.palette import labels_of

_UNITS = {"final_pos_mm": " mm", "final_rot_deg": "°"}


def verdict(
    found: Recommendation, summary: Summary, order: Sequence[str], folds: Sequence[str]
) -> str:
    """Return the recommended model and what it gains, with 95 % intervals.

    Args:
        found: the recommendation.
        summary: that it rests on.
        order: slugs of the models, from the engine as it is and the identified one.
        folds: conditions, each a division into folds.
    """
    labels = labels_of(summary.models)
    named = " and ".join(folds)
    name, engines = labels[found.model], order[:2]
    if found.model == order[0]:
        opening = "Neither identification nor learning is worth it here: no model errs "
        opening += f"clearly less than {name}"
    elif found.model in engines:
        opening = f"Identify, do not learn: {name} errs less than the engine as it is, "
        opening += "and no learned model errs clearly less still"
    else:
        opening = f"Learning is worth it here: {name} errs clearly less at the end of "
        opening += "pushes than the engine, identified or not"
    parts = [_of_folds(found, summary, label) for label in folds]
    return f"{opening} (folds by {named}). {' '.join(parts)}"


def _of_folds(found: Recommendation, summary: Summary, folds: str) -> str:
    """Return errors and gains in one division into folds."""
    labels = labels_of(summary.models)
    errors = " and ".join(
        _sizes(summary.errors(found.model, metric, folds), metric) for metric in ENDS
    )
    gains = [gain for gain in found.gains if gain.condition == folds]
    less = [
        f"{' and '.join(_differences(gains, other))} less than {labels[other]}"
        for other in dict.fromkeys(gain.against for gain in gains)
    ]
    return f"By {folds}: {', '.join([errors, *less])}."


def _sizes(errors: Sequence[float], metric: str) -> str:
    values = " / ".join(f"{error:.2f}" for error in errors)
    return values + _UNITS[metric]


def _differences(gains: Sequence[Gain], against: str) -> Iterator[str]:
    for gain in gains:
        if gain.against == against:
            sizes = " / ".join(map(_less, gain.difference))
            yield sizes + _UNITS[gain.metric]


def _less(difference: Estimate) -> str:
    """Return by how much less, with the interval."""
    value, low, high = (
        None if number is None else -number
        for number in (difference.value, difference.high, difference.low)
    )
    interval = "" if low is None else f" [{low:.2f}, {high:.2f}]"
    return f"{value:.2f}{interval}".replace("-", "−")  # noqa: RUF001
