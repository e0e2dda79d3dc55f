"""What a card may say: checked when it is read, before anything is made of it."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from sainet.models.features import ACTIONS, FEATURES
from sainet.runs.documents import is_number
from sainet.runs.errors import BadCheckpoint

_Check = tuple[Callable[[Any], bool], str]


def _is_positive_list(value: object) -> bool:
    return (
        isinstance(value, list)
        and len(value) > 0
        and all(is_number(v) and v > 0 for v in value)
    )


def _are_seeds(value: object) -> bool:
    return isinstance(value, list) and all(type(seed) is int for seed in value)


def _or_none(check: Callable[[Any], bool]) -> Callable[[Any], bool]:
    return lambda value: value is None or check(value)


def _is(kind: type) -> Callable[[Any], bool]:
    return lambda value: isinstance(value, kind)


_FIELDS: dict[str, _Check] = {
    "model": (lambda v: v in ("in", "sain"), "'in' or 'sain'"),
    "kind": (lambda v: v in tuple(ACTIONS), "one of " + ", ".join(ACTIONS)),
    "time_step": (
        lambda v: isinstance(v, float) and 0 < v < 1,
        "in seconds, between 0 and 1",
    ),
    "features": (lambda v: v in FEATURES, "one of " + ", ".join(FEATURES)),
    "inner_engine": (_or_none(_is(str)), "the name of an engine or null"),
    "truth_engine": (_is(str), "the name of an engine"),
    "assumed": (_or_none(_is(dict)), "an object or null"),
    "data": (_is(str), "a hash"),
    "data_seed": (_or_none(is_number), "a number or null"),
    "weights": (_is(str), "a hash"),
    "config": (_is(dict), "an object"),
    "manifest": (_is(dict), "an object"),
    "started_from": (_or_none(_is(str)), "a hash or null"),
    "earlier_seeds": (_are_seeds, "a list of whole numbers"),
    "recurrent": (_is(bool), "true or false"),
    "residual": (_is(bool), "true or false"),
    "final_loss": (_or_none(is_number), "a number or null"),
}

_ADDS_TO_AN_ENGINE: _Check = (lambda v: v == "sain", "'sain' where residual is true")

_ASSUMED: dict[str, _Check] = {
    "mass": (_or_none(_is_positive_list), "a list of positive numbers (kg) or null"),
    "radius": (_or_none(_is_positive_list), "a list of positive numbers (m) or null"),
    "friction": (
        _or_none(lambda v: is_number(v) and v >= 0),
        "a number from 0 up or null",
    ),
    **dict.fromkeys(
        # Of an engine that was identified.
        ("pusher_friction", "disk_friction", "pressure_radius_ratio"),
        (_or_none(lambda v: is_number(v) and v > 0), "a positive number or null"),
    ),
    **dict.fromkeys(
        ("camera_x_mm", "camera_y_mm"), (_or_none(is_number), "a number or null")
    ),
}


def check_card(path: Path, found: dict[str, Any]) -> None:
    """Raise `BadCheckpoint` if a field holds what no card of ours says.

    Args:
        path: of the card, to be named.
        found: all fields of the card, as they were read.
    """
    for name, check in _FIELDS.items():
        _require(path, name, found[name], check)
    for name, check in _ASSUMED.items():
        _require(path, f"assumed.{name}", (found["assumed"] or {}).get(name), check)
    if found["residual"]:
        _require(path, "model", found["model"], _ADDS_TO_AN_ENGINE)


def _require(path: Path, name: str, value: object, check: _Check) -> None:
    good, wanted = check
    if not good(value):
        raise BadCheckpoint(
            f"{path}: {name} is {value!r}; it must be {wanted}. Train it again."
        )
