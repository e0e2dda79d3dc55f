"""Summaries as the JSON objects that commands print with ``--json``."""

from collections.abc import Mapping

import msgspec

from sainet.evaluation.summary import Estimate, Row, Summary
from sainet.evaluation.trials import TrialRow, TrialTest


def to_json_object(summary: Summary) -> dict[str, object]:
    """Return rows, comparisons and published rows as JSON values."""
    if summary.is_of_trials:
        worlds = {c.label: c.factors.get("world") for c in summary.conditions}
        found: dict[str, object] = {
            "rows": [_of_world(row, worlds) for row in summary.trials],
            "pairs": [_of_world(test, worlds) for test in summary.tests],
            "published": [
                {
                    "group": each.condition,
                    "model": each.model.slug,
                    "trials": each.trials,
                    "success": each.values["success"][0],
                }
                for each in summary.published
            ],
        }
        if summary.outcomes:
            found["outcomes"] = msgspec.to_builtins(summary.outcomes)
            found["differences"] = msgspec.to_builtins(summary.differences)
        return found
    return {
        "rows": [_row(row) for row in summary.rows],
        "published": [
            *(_row(row, with_intervals=False) for row in summary.predictions),
            *_published(summary),
        ],
        "comparisons": [
            {
                "model": each.model,
                "against": each.against,
                "group": each.condition or None,
                "body": each.body,
                "metric": each.metric,
                "difference": each.difference.value,
                "interval": _ends(each.difference),
            }
            for each in summary.comparisons
        ],
    }


def _row(row: Row, *, with_intervals: bool = True) -> dict[str, object]:
    found: dict[str, object] = {
        "model": row.model,
        "body": row.body,
        "group": row.condition or None,
        "n": row.count,
        "trainings": row.trainings,
    }
    for key, estimate in row.values.items():
        found[key] = estimate.value
        if with_intervals:
            found[f"{key}_interval"] = _ends(estimate)
    return found


def _ends(estimate: Estimate) -> list[float | None]:
    return [estimate.low, estimate.high]


def _published(summary: Summary) -> list[dict[str, object]]:
    return [
        {
            "model": each.model.slug,
            "body": body + 1,
            "group": each.condition or None,
            **{metric: values[body] for metric, values in each.values.items()},
        }
        for each in summary.published
        for body in range(len(next(iter(each.values.values()))))
    ]


def _of_world(
    found: TrialRow | TrialTest, worlds: Mapping[str, float | str | None]
) -> dict[str, object]:
    """Return every field, beginning with the condition and its world."""
    fields: dict[str, object] = msgspec.to_builtins(found)
    del fields["condition"]
    return {"group": found.condition, "world": worlds[found.condition], **fields}
