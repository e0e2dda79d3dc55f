"""What trials say of a model: success, its interval, and what tells models apart."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.stats import binomtest

from sainet.control.episode import SOLVED

_NEAR_MM = 4.0
_FEW_PUSHES = 25

Records = Sequence[dict[str, Any]]


def summarise(records: Records) -> dict[str, Any]:
    """Return success with its Wilson 95 % interval, medians and shares."""
    solved = np.array([record["solved"] for record in records])
    pushes = np.array([record["pushes"] for record in records])
    final = np.array([record["final_mm"] for record in records])
    seconds = [s for record in records for s in record["decision_s"]]
    # Seen within the tolerance, and truly without: sight is noisy.
    ended = np.array([record["reason"] == SOLVED for record in records])
    interval = binomtest(int(solved.sum()), len(solved)).proportion_ci(method="wilson")
    return {
        "trials": len(records),
        "solved": int(solved.sum()),
        "success": float(solved.mean()),
        "interval": [float(interval.low), float(interval.high)],
        "median_pushes": float(np.median(pushes[solved])) if solved.any() else None,
        "median_decision_s": float(np.median(seconds)) if seconds else None,
        "within_4_mm": float((final <= _NEAR_MM).mean()),
        "within_25_pushes": float((solved & (pushes <= _FEW_PUSHES)).mean()),
        "median_final_mm": float(np.median(final)),
        "ended_early": int((ended & ~solved).sum()),
    }


def paired_test(one: Records, other: Records, key: str = "solved") -> dict[str, Any]:
    """Compare two models on the same goals by the exact McNemar test.

    Args:
        one: the records of a model, goal by goal.
        other: those of another, of the same goals.
        key: of what either did or did not.

    Returns:
        How many goals only the one and only the other solved, and the p-value.
    """
    pairs = [(bool(a[key]), bool(b[key])) for a, b in zip(one, other, strict=True)]
    only_one = sum(a and not b for a, b in pairs)
    only_other = sum(b and not a for a, b in pairs)
    unlike = only_one + only_other
    p = binomtest(only_one, unlike).pvalue if unlike else 1.0
    return {"only_one": only_one, "only_other": only_other, "p": float(p)}
