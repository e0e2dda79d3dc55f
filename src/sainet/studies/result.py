"""Results of studies: a summary, and what some studies add to it."""

from typing import Any

import msgspec

from sainet.evaluation.as_json import to_json_object
from sainet.evaluation.summary import Summary

TABLE = "table.json"


class Choice(msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True):
    """One setting that a study tried, and its score: errors over those of physics."""

    score: float
    l2: float | None = None
    pushes: int | None = None
    start: str | None = None
    change: dict[str, float | str | bool] | None = None  # to the defaults
    scores: dict[str, float] | None = None  # by robot


class Result(msgspec.Struct, frozen=True, kw_only=True):
    """The result of a study, as it is kept in its folder."""

    summary: Summary
    as_trained: Summary | None = None  # of pushes like those of the training
    choices: tuple[Choice, ...] = ()

    def to_json(self) -> dict[str, Any]:
        """Return the JSON object that commands print."""
        found = to_json_object(self.summary)
        if self.as_trained is not None:
            found["as_trained"] = to_json_object(self.as_trained)
        if self.choices:
            found["choices"] = msgspec.to_builtins(self.choices)
        return found
