"""What trials say of a model: success, its interval, and what tells models apart."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from jaxtyping import Bool, Float
from scipy.stats import binomtest

from sainet.control.episode import SOLVED

# What an episode reaches or does not.
MEASURES = ("solved", "within_4_mm", "within_25_pushes")
_NEAR_MM = 4.0
_FEW_PUSHES = 25

Records = Sequence[dict[str, Any]]


def summarise(records: Records) -> dict[str, Any]:
    """Return success with its Wilson 95 % interval, medians and shares."""
    solved, near, soon = (reached(records, measure) for measure in MEASURES)
    pushes, final = _column(records, "pushes"), _final_mm(records)
    seconds = [s for record in records for s in record["decision_s"]]
    # Seen within the tolerance, and truly without: sight is noisy.
    ended = np.array([record["reason"] == SOLVED for record in records])
    median = float(np.median(final))
    interval = binomtest(int(solved.sum()), len(solved)).proportion_ci(method="wilson")
    return {
        "trials": len(records),
        "solved": int(solved.sum()),
        "success": float(solved.mean()),
        "interval": [float(interval.low), float(interval.high)],
        "median_pushes": float(np.median(pushes[solved])) if solved.any() else None,
        "median_decision_s": float(np.median(seconds)) if seconds else None,
        "within_4_mm": float(near.mean()),
        "within_25_pushes": float(soon.mean()),
        "median_final_mm": median if np.isfinite(median) else None,
        "ended_early": int((ended & ~solved).sum()),
    }


def reached(records: Records, measure: str) -> Bool[np.ndarray, " record"]:
    """Return which episodes reached one of `MEASURES`."""
    solved = _column(records, "solved")
    if measure == "within_4_mm":
        return _final_mm(records) <= _NEAR_MM
    if measure == "within_25_pushes":
        return solved & (_column(records, "pushes") <= _FEW_PUSHES)
    return solved


def _final_mm(records: Records) -> Float[np.ndarray, " record"]:
    """Return how far each episode ended from its goal; infinite where it diverged."""
    far = [record["final_mm"] for record in records]
    return np.array([np.inf if distance is None else distance for distance in far])


def _column(records: Records, name: str) -> np.ndarray:
    return np.array([record[name] for record in records])


def paired_test(
    one: Records, other: Records, measure: str = "solved"
) -> dict[str, Any]:
    """Compare two models on the same goals by the exact McNemar test.

    Args:
        one: the records of a model, goal by goal.
        other: those of another, of the same goals.
        measure: one of `MEASURES`.

    Returns:
        How many goals only the one and only the other reached, and the p-value.
    """
    mine, theirs = reached(one, measure), reached(other, measure)
    only_one, only_other = int((mine & ~theirs).sum()), int((theirs & ~mine).sum())
    unlike = only_one + only_other
    p = binomtest(only_one, unlike).pvalue if unlike else 1.0
    return {"only_one": only_one, "only_other": only_other, "p": float(p)}
