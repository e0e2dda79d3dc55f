"""Errors of predicted pushes: those measured on each push, and those in tables.

A new error is one `Metric`, and one entry of `MEASURED` if it needs a new measurement.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Literal

import numpy as np
from jaxtyping import Bool, Float

from sainet.datasets.store import last_known
from sainet.evaluation.intervals import Folds, Interval, Sample
from sainet.runs.errors import Diverged
from sainet.scenes.geometry import wrap_angle

_AT_REST_MM = 1e-3  # mean travel below which a body is at rest
REFERENCE_DISTANCE = {"simulated": 0.25, "recorded": 0.345}  # m, for trans (%)

Errors = dict[str, np.ndarray]  # each [..., push, body], by the names in `MEASURED`


@dataclass(frozen=True)
class Offsets:
    """Distances between predicted and true poses; zero where the truth is unknown."""

    position_mm: Float[np.ndarray, "push time body"]
    rotation_deg: Float[np.ndarray, "push time body"]
    observed: Bool[np.ndarray, "push time"]

    def mean(self, values: np.ndarray) -> Float[np.ndarray, "push body"]:
        """Return the mean over the observed steps of each push; NaN without any."""
        count = self.observed.sum(axis=1).astype(float)
        summed = np.where(self.observed[..., None], values, 0.0).sum(axis=1)
        return summed / np.where(count, count, np.nan)[:, None]

    def last(self, values: np.ndarray) -> Float[np.ndarray, "push body"]:
        """Return the value at the last observed step of each push; NaN without any."""
        return last_known(values, self.observed)


MEASURED: Mapping[str, Callable[[Offsets], Float[np.ndarray, "push body"]]] = {
    "pos_mm": lambda offsets: offsets.mean(offsets.position_mm),
    "rot_deg": lambda offsets: offsets.mean(offsets.rotation_deg),
    "final_pos_mm": lambda offsets: offsets.last(offsets.position_mm),
    "final_rot_deg": lambda offsets: offsets.last(offsets.rotation_deg),
}


@dataclass(frozen=True)
class ModelErrors:
    """Errors of one model on the pushes of one condition, and what they relate to."""

    errors: Errors
    travel_mm: Float[np.ndarray, "push body"]
    reference_m: float  # distance that trans (%) relates to
    folds: Folds | None = None  # of each push, in a cross-validation

    @cached_property
    def samples(self) -> dict[str, Sample]:
        """The measured errors with their resamples."""
        return {name: Sample(v, self.folds) for name, v in self.errors.items()}

    def mean(self, name: str, factor: float = 1.0) -> Interval:
        """Return the mean of a measured error times a factor, with its interval."""
        value, low, high = self.samples[name].interval
        return _times((value, np.maximum(low, 0), high), factor)

    def per_travel(self, name: str) -> Interval:
        """Return the mean of an error over the mean travel (%), with its interval.

        Unknown (NaN) for a body at rest, and without an interval for one that moves in
        so few pushes that a resample may lack them all.
        """
        travel = Sample(self.travel_mm, self.folds)
        value, *ends = _times(self.samples[name].over(travel), 100)
        rests = travel.mean < _AT_REST_MM
        may_rest = rests | (np.percentile(travel.drawn(), 2.5, axis=0) < _AT_REST_MM)
        low, high = (np.where(may_rest, np.nan, end) for end in ends)
        return np.where(rests, np.nan, value), low, high


@dataclass(frozen=True)
class Metric:
    """One number of a table: its name, its unit, and its estimator from the errors."""

    key: str
    name: str
    unit: str
    estimator: Callable[[ModelErrors], Interval] | None = None  # None: the mean
    digits: int = 2  # after the point
    direction: Literal["less", "more"] = "less"  # is better
    is_of_end: bool = False  # of the end of a push, not of all its steps

    @property
    def heading(self) -> str:
        """The name with its unit."""
        return f"{self.name} ({self.unit})"

    def of(self, errors: ModelErrors) -> Interval:
        """Return the number of each body with its interval."""
        return self.estimator(errors) if self.estimator else errors.mean(self.key)


# In the order of JSON; tables have an order of their own.
METRICS = {
    metric.key: metric
    for metric in (
        Metric("pos_mm", "pos", "mm"),
        Metric("rot_deg", "rot", "deg"),
        Metric("final_pos_mm", "final pos", "mm", is_of_end=True),
        Metric("final_rot_deg", "final rot", "deg", is_of_end=True),
        Metric(
            "relative_percent",
            "pos/travel",
            "%",
            lambda errors: errors.per_travel("final_pos_mm"),
            digits=1,
            is_of_end=True,
        ),
        Metric(
            "trans_percent",
            "trans",
            "%",
            lambda errors: errors.mean("pos_mm", 0.1 / errors.reference_m),
        ),
    )
}


def push_errors(
    predicted: Float[np.ndarray, "push time body 3"],
    true: Float[np.ndarray, "push time body 3"],
    observed: Bool[np.ndarray, "push time"],
) -> Errors:
    """Return the errors of predicted poses (m, rad) where the true ones are known."""
    offset = predicted - np.where(observed[..., None, None], true, predicted)
    offsets = Offsets(
        position_mm=1000 * np.linalg.norm(offset[..., :2], axis=-1),
        # An angle error is never more than half a turn.
        rotation_deg=np.abs(np.rad2deg(wrap_angle(offset[..., 2]))),
        observed=observed,
    )
    return {name: measure(offsets) for name, measure in MEASURED.items()}


def final_errors(
    predicted: Float[np.ndarray, "push body 3"], true: Float[np.ndarray, "push body 3"]
) -> Errors:
    """Return the errors of predicted final poses; the means over time are unknown."""
    observed = np.ones((len(true), 1), bool)
    ends = push_errors(predicted[:, None], true[:, None], observed)
    known = {name for name, metric in METRICS.items() if metric.is_of_end}
    return {k: v if k in known else np.full_like(v, np.nan) for k, v in ends.items()}


def travel_mm(
    initial: Float[np.ndarray, "push body 3"], final: Float[np.ndarray, "push body 3"]
) -> Float[np.ndarray, "push body"]:
    """Return the distance between initial and final position of each body (mm)."""
    return 1000 * np.linalg.norm(final[..., :2] - initial[..., :2], axis=-1)


def check_finite(
    model: str, path: Path, poses: Float[np.ndarray, "push time body 3"]
) -> None:
    """Raise `Diverged` if a pose is not finite: no mean of the model would be known."""
    lost = np.flatnonzero(~np.isfinite(poses).all(axis=(1, 2, 3)))
    if len(lost):
        raise Diverged(
            f"{model}: its prediction of push {lost[0]} of {path} is not finite, nor "
            f"are {len(lost) - 1} more of {len(poses)}; leave the model out, or train "
            "it again."
        )


def _times(values: Interval, factor: float) -> Interval:
    value, low, high = values
    return factor * value, factor * low, factor * high
