"""Summaries as the JSON objects that commands print with ``--json``."""

from sainet.evaluation.summary import Estimate, Row, Summary
from sainet.evaluation.trials import TrialRow, TrialTest

Json = dict[str, object]


def to_json_object(summary: Summary) -> Json:
    """Return rows, comparisons and published rows as JSON values."""
    if summary.is_of_trials:
        worlds = {c.label: c.factors.get("world") for c in summary.conditions}
        return {
            "rows": [_trial_row(row, worlds[row.condition]) for row in summary.trials],
            "pairs": [_test(each, worlds[each.condition]) for each in summary.tests],
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


def _row(row: Row, *, with_intervals: bool = True) -> Json:
    found: Json = {
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


def _published(summary: Summary) -> list[Json]:
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


def _trial_row(row: TrialRow, world: object) -> Json:
    return {"group": row.condition, "world": world, "model": row.model} | row.to_dict()


def _test(test: TrialTest, world: object) -> Json:
    return {
        "group": test.condition,
        "world": world,
        "measure": test.measure,
        "model": test.model,
        "against": test.against,
        "only_one": test.only_one,
        "only_other": test.only_other,
        "p": test.p,
    }
