"""Outcomes of trials in several labs: means with intervals, and paired differences."""

from collections.abc import Iterator
from itertools import combinations

import msgspec
import numpy as np
from jaxtyping import Float

from sainet.evaluation.intervals import Estimate, Sample, estimate, folds_of
from sainet.evaluation.measurements import Condition, Measurements
from sainet.evaluation.trials import was_tried

_VERY_NEAR_MM = 2.0


class TrialOutcome(msgspec.Struct, frozen=True, kw_only=True):
    """Means over the trials of one model in one condition, in several labs."""

    condition: str
    model: str  # slug
    values: dict[str, Estimate]  # by the names in `OUTCOMES`


class TrialDifference(msgspec.Struct, frozen=True, kw_only=True):
    """A paired difference of two models: the first minus the other."""

    condition: str
    measure: str  # one of `OUTCOMES`
    model: str
    against: str
    difference: Estimate


# Means over labs and trials: shares of trials, and amounts.
OUTCOMES = ("solved", "within_2_mm", "pushes", "overshoot_mm", "stuck")
_AMOUNTS = ("pushes", "overshoot_mm")


def trial_outcomes(measured: Measurements) -> Iterator[TrialOutcome]:
    """Yield the means of every outcome with their intervals over labs and trials."""
    for condition, samples in _in_labs(measured):
        for slug, sample in samples.items():
            shares = Sample(np.clip(sample.values, 0, 1), sample.folds).share
            found = dict.fromkeys(OUTCOMES, shares) | dict.fromkeys(
                _AMOUNTS, sample.interval
            )
            values = {name: estimate(found[name], n) for n, name in enumerate(OUTCOMES)}
            yield TrialOutcome(condition=condition.label, model=slug, values=values)


def trial_differences(measured: Measurements) -> Iterator[TrialDifference]:
    """Yield the paired differences of every pair of models, for each outcome."""
    for condition, samples in _in_labs(measured):
        for against, model in combinations(samples, 2):
            found = samples[model].minus(samples[against])
            for number, name in enumerate(OUTCOMES):
                yield TrialDifference(
                    condition=condition.label,
                    measure=name,
                    model=model,
                    against=against,
                    difference=estimate(found, number),
                )


def _in_labs(measured: Measurements) -> Iterator[tuple[Condition, dict[str, Sample]]]:
    """Yield the outcomes of every model by condition, if they are of labs."""
    for condition in measured.header.conditions if measured.header.has_labs else ():
        part = measured.samples_of(condition)
        folds = folds_of(measured.data["fold"].values[part], are_labs=True)
        yield (
            condition,
            {
                slug: Sample(_outcomes(measured, slug)[part], folds)
                for slug in measured.slugs
                if was_tried(measured, slug, condition)
            },
        )


def _outcomes(measured: Measurements, slug: str) -> Float[np.ndarray, "trial outcome"]:
    near = measured.values("final_mm", slug) <= _VERY_NEAR_MM
    columns = [
        near if name == "within_2_mm" else measured.values(name, slug)
        for name in OUTCOMES
    ]
    return np.column_stack(columns).astype(np.float64)
