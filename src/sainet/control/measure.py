"""Records of episodes as measurements."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr

from sainet.control.episode import SOLVED
from sainet.evaluation.conditions import Condition, Header
from sainet.evaluation.measurements import Measurements
from sainet.models.identity import ModelId

Records = Sequence[Mapping[str, Any]]


def measure_trials(
    records: Mapping[ModelId, Records], condition: Condition | None = None
) -> Measurements:
    """Return the measurements of trials.

    Args:
        records: of each model, the same goals in the same order.
        condition: that all trials belong to.
    """
    found = list(records.values())
    count = len(found[0])
    longest = max(len(each["decision_s"]) for part in found for each in part)
    seconds = np.full((len(found), count, longest), np.nan)
    for model, part in enumerate(found):
        for trial, each in enumerate(part):
            seconds[model, trial, : len(each["decision_s"])] = each["decision_s"]
    columns = {
        "solved": [[float(each["solved"]) for each in part] for part in found],
        # The measured pose may lie within the tolerance while the true one does not.
        "ended": [[float(each["reason"] == SOLVED) for each in p] for p in found],
        "pushes": [[float(each["pushes"]) for each in part] for part in found],
        # An episode that diverged ended infinitely far from its goal.
        "final_mm": [
            [np.inf if e["final_mm"] is None else e["final_mm"] for e in part]
            for part in found
        ],
    }
    numbers = np.arange(count, dtype=np.int32)
    places = {"condition": 0 * numbers, "fold": 0 * numbers - 1, "row": numbers}
    data = xr.Dataset(
        {name: (("model", "sample"), values) for name, values in columns.items()}
        | {"decision_s": (("model", "sample", "decision"), seconds)},
        {name: ("sample", values) for name, values in places.items()},
    )
    return Measurements(
        data, Header(models=tuple(records), conditions=(condition or Condition(),))
    )
