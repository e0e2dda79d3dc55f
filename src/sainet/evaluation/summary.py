"""Summaries: means with intervals by condition, model and body; and comparisons."""

from collections.abc import Iterator, Sequence
from itertools import combinations

import msgspec
import numpy as np

from sainet.evaluation import measurements
from sainet.evaluation.intervals import Estimate, Sample, estimate, folds_of, known
from sainet.evaluation.lab_outcomes import (
    TrialDifference,
    TrialOutcome,
    trial_differences,
    trial_outcomes,
)
from sainet.evaluation.metrics import MEASURED, METRICS, ModelErrors
from sainet.evaluation.trials import TrialRow, TrialTest, compare_trials, trial_rows
from sainet.models.identity import ModelId


class Row(msgspec.Struct, frozen=True, kw_only=True):
    """The errors of one model on one body, in one condition."""

    condition: str
    model: str  # slug
    body: int  # 1-based
    values: dict[str, Estimate]  # by metric
    count: int | None = None  # pushes
    trainings: int = 1


class Comparison(msgspec.Struct, frozen=True, kw_only=True):
    """A paired difference of two models: the first minus the other."""

    condition: str
    model: str
    against: str
    body: int
    metric: str
    difference: Estimate
    p: float | None = None  # two-sided, that chance alone makes such a difference


class Factor(msgspec.Struct, frozen=True, kw_only=True):
    """By which factor the physics engine errs more than a model, over all bodies."""

    condition: str
    model: str
    metric: str
    error: float
    baseline: float  # error of the engine
    factor: Estimate
    difference: Estimate = Estimate()  # error of the model minus that of the engine


class Summary(msgspec.Struct, frozen=True, kw_only=True):
    """Everything that tables, figures and claims read."""

    models: tuple[ModelId, ...]
    conditions: tuple[measurements.Condition, ...] = (measurements.Condition(),)
    rows: tuple[Row, ...] = ()
    predictions: tuple[Row, ...] = ()  # published predictions of the same pushes
    comparisons: tuple[Comparison, ...] = ()
    factors: tuple[Factor, ...] = ()
    trials: tuple[TrialRow, ...] = ()
    tests: tuple[TrialTest, ...] = ()
    outcomes: tuple[TrialOutcome, ...] = ()  # of trials in labs
    differences: tuple[TrialDifference, ...] = ()
    published: tuple[measurements.PublishedValues, ...] = ()
    provenance: measurements.Provenance = measurements.Provenance()

    @property
    def is_of_trials(self) -> bool:
        """Whether it summarises control trials, not prediction errors."""
        return bool(self.trials)

    def errors(
        self, model: str, metric: str, condition: str | None = None
    ) -> list[float]:
        """Return the known values of one model and metric, body by body."""
        found = [
            row.values[metric].value
            for row in self.rows
            if row.model == model and condition in (None, row.condition)
        ]
        return [value for value in found if value is not None]


BASELINE = "physics"


def summarise(measured: measurements.Measurements, *, subject: str = "") -> Summary:
    """Return means, intervals and paired comparisons.

    Args:
        measured: pushes or trials.
        subject: slug of the model that all others are compared with, as models that
            abstain are with the engine; by default every model is with every other.
    """
    header = measured.header
    found = Summary(
        models=header.models,
        conditions=header.conditions,
        published=header.published,
        provenance=header.provenance,
    )
    if measured.is_of_trials:
        return _of_trials(measured, found)
    rows: list[Row] = []
    predictions: list[Row] = []
    parts = [_Part(measured, condition) for condition in header.conditions]
    for part in parts:
        for slug in part.slugs:
            is_prediction = slug in header.predictions
            (predictions if is_prediction else rows).extend(
                part.rows(slug, with_intervals=not is_prediction)
            )
    pairs = _pairs(measured, subject)
    order = [(p, part) for p in pairs for part in parts]
    if subject:  # condition by condition
        order = [(p, part) for part in parts for p in pairs]
    compared = [
        each
        for (one, other), part in order
        for each in part.compare(one, other)
        if not (subject and part.has_only_ends) or METRICS[each.metric].is_of_end
    ]
    return msgspec.structs.replace(
        found,
        rows=tuple(rows),
        predictions=tuple(predictions),
        comparisons=tuple(compared),
        factors=tuple(each for part in parts for each in part.factors()),
    )


def _of_trials(measured: measurements.Measurements, found: Summary) -> Summary:
    return msgspec.structs.replace(
        found,
        trials=trial_rows(measured),
        tests=compare_trials(measured),
        outcomes=tuple(trial_outcomes(measured)),
        differences=tuple(trial_differences(measured)),
    )


def _pairs(measured: measurements.Measurements, subject: str) -> list[tuple[str, str]]:
    predictions = measured.header.predictions
    ours = [slug for slug in measured.slugs if slug not in predictions]
    if subject:
        others = [slug for slug in (*ours, *predictions) if slug != subject]
        abstaining = [m.slug for m in measured.header.models if m.abstains]
        beside = [(slug, BASELINE) for slug in abstaining if BASELINE in others]
        return [*((subject, other) for other in others), *beside]
    return [(other, one) for one, other in combinations(ours, 2)]


class _Part:
    """The pushes of one condition."""

    def __init__(
        self, measured: measurements.Measurements, condition: measurements.Condition
    ) -> None:
        self.condition = condition
        part = measured.samples_of(condition)
        travel = measured.data["travel_mm"].values[part]
        self.bodies = int(np.isfinite(travel).any(axis=0).sum()) or travel.shape[1]
        self.travel_mm = travel[:, : self.bodies]
        folds = measured.data["fold"].values[part]
        self.folds = folds_of(folds, are_labs=measured.header.has_labs)
        self.reference_m = measured.header.reference_m
        self.models = {
            slug: errors
            for slug in measured.slugs
            if (errors := self._errors(measured, slug, part)) is not None
        }

    @property
    def slugs(self) -> Sequence[str]:
        """The models that were measured in the condition."""
        return list(self.models)

    def _errors(
        self, measured: measurements.Measurements, slug: str, part: np.ndarray
    ) -> ModelErrors | None:
        found = {name: measured.values(name, slug)[..., part, :] for name in MEASURED}
        trained = max((v.shape[0] for v in found.values() if v.ndim > 2), default=1)  # noqa: PLR2004
        known = {
            name: self._trained(values, trained)[..., : self.bodies]
            for name, values in found.items()
        }
        if not any(np.isfinite(values).any() for values in known.values()):
            return None
        return ModelErrors(known, self.travel_mm, self.reference_m, self.folds)

    @staticmethod
    def _trained(values: np.ndarray, trained: int) -> np.ndarray:
        """Return values without the training runs that this condition does not have."""
        if trained == 1:
            return values
        wide = values if values.ndim > 2 else np.stack([values] * trained)  # noqa: PLR2004
        is_known = np.isfinite(wide).any(axis=(1, 2))
        if is_known.all() or not is_known.any():
            return wide
        return wide[is_known] if is_known.sum() > 1 else wide[is_known][0]

    def rows(self, slug: str, *, with_intervals: bool) -> Iterator[Row]:
        """Yield the row of each body."""
        errors = self.models[slug]
        found = {key: metric.of(errors) for key, metric in METRICS.items()}
        shape = errors.errors["pos_mm"].shape
        for body in range(self.bodies):
            yield Row(
                condition=self.condition.label,
                model=slug,
                body=body + 1,
                count=len(self.travel_mm),
                trainings=shape[0] if len(shape) > 2 else 1,  # noqa: PLR2004
                values={
                    key: estimate(each, body, with_interval=with_intervals)
                    for key, each in found.items()
                },
            )

    def compare(self, model: str, against: str) -> Iterator[Comparison]:
        """Yield the paired differences of two models."""
        if not {model, against} <= self.models.keys():
            return
        one, other = self.models[model].samples, self.models[against].samples
        for metric in MEASURED:
            found = one[metric].minus(other[metric])
            chance = one[metric].chance(other[metric])
            if not np.isfinite(found[0]).any():
                continue  # not measured for either
            for body in range(self.bodies):
                yield Comparison(
                    condition=self.condition.label,
                    model=model,
                    against=against,
                    body=body + 1,
                    metric=metric,
                    difference=estimate(found, body),
                    p=known(float(chance[body])),
                )

    def factors(self) -> Iterator[Factor]:
        """Yield how many times more than each model the physics engine errs."""
        baseline = self.models.get(BASELINE)
        if baseline is None:
            return
        metric = "final_pos_mm" if self.has_only_ends else "pos_mm"
        above = self._over_bodies(baseline, metric)
        for slug, errors in self.models.items():
            below = self._over_bodies(errors, metric)
            if not np.isfinite(below.values).all():
                continue
            yield Factor(
                condition=self.condition.label,
                model=slug,
                metric=metric,
                error=float(below.values.mean()),
                baseline=float(above.values.mean()),
                factor=estimate(above.over(below, trained_apart=True), 0),
                difference=estimate(below.minus(above), 0),
            )

    def _over_bodies(self, errors: ModelErrors, metric: str) -> Sample:
        values = errors.errors[metric].mean(axis=-1, keepdims=True)
        return Sample(values, self.folds)

    @property
    def has_only_ends(self) -> bool:
        """Whether the ends of pushes were observed and nothing else."""
        return all(
            np.array_equal(each.errors["pos_mm"], each.errors["final_pos_mm"])
            or not np.isfinite(each.errors["pos_mm"]).any()
            for each in self.models.values()
        )
