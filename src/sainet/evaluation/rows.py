"""Rows of error tables: means over pushes, with intervals, for each body."""

from typing import Any

import numpy as np

from sainet.evaluation.intervals import (
    Folds,
    difference_interval,
    mean_interval,
    ratio_interval,
)
from sainet.evaluation.metrics import PushErrors

METRICS = ("pos_mm", "rot_deg", "final_pos_mm", "final_rot_deg")


def error_rows(
    model: str,
    errors: PushErrors,
    travel_mm: np.ndarray,
    *,
    group: str | None,
    reference: float,
    folds: Folds | None = None,
) -> list[dict[str, Any]]:
    """Return one row for each body (1-based).

    Args:
        model: its name.
        errors: of the pushes of one group.
        travel_mm: how far the bodies were moved, ``[push, body]``.
        group: its name, if the pushes have groups.
        reference: m, that `trans_percent` is relative to.
        folds: of each push, where the errors are of a cross-validation.
    """
    found = {name: mean_interval(getattr(errors, name), folds) for name in METRICS}
    found["relative_percent"] = _times(
        ratio_interval(errors.final_pos_mm, travel_mm, folds), 100
    )
    found["trans_percent"] = _times(found["pos_mm"], 0.1 / reference)
    rows = []
    for body in range(travel_mm.shape[1]):
        row = {"model": model, "body": body + 1, "group": group, "n": len(travel_mm)}
        row["trainings"] = errors.trainings
        for name, (mean, low, high) in found.items():
            row[name] = _number(mean[body])
            row[name + "_interval"] = [_number(low[body]), _number(high[body])]
        rows.append(row)
    return rows


def comparison_rows(
    one: tuple[str, PushErrors],
    other: tuple[str, PushErrors],
    *,
    group: str | None,
    folds: Folds | None = None,
) -> list[dict[str, Any]]:
    """Return paired differences, one minus other, for each metric and body."""
    rows = []
    for metric in METRICS:
        values = getattr(one[1], metric), getattr(other[1], metric)
        mean, low, high = difference_interval(*values, folds)
        rows += [
            {
                "model": one[0],
                "against": other[0],
                "group": group,
                "body": body + 1,
                "metric": metric,
                "difference": _number(mean[body]),
                "interval": [_number(low[body]), _number(high[body])],
            }
            for body in range(len(mean))
        ]
    return rows


def _times(values: tuple, factor: float) -> tuple:
    return tuple(factor * value for value in values)


def _number(value: float) -> float | None:
    """Return a number that JSON can hold; what is not known is None."""
    return float(value) if np.isfinite(value) else None
