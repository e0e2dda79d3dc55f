"""Checks of the record of an episode before it is drawn or summarised."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from sainet.runs.documents import is_number

Axis = int | str  # a length, or the name of a length; equal names have equal lengths

_TYPES: dict[str, type] = {
    **{"trial": int, "model": str, "goals": str, "reason": str, "solved": bool},
    **{"pushes": int, "moved": int, "turns": list},
}
_NUMBERS: dict[str, tuple[Axis, ...]] = {
    **{"pusher_radius_mm": (), "tolerance_mm": (), "table_friction": ()},
    **{"goal_mm": (2,), "radius_mm": ("disk",), "decision_s": ("decision",)},
}
# Poses: null stands for NaN and infinity.
_PLACES: dict[str, tuple[Axis, ...]] = {"final_mm": (), "final": ("disk", 3)}
_TURN_PLACES: dict[str, tuple[Axis, ...]] = {
    **{"observed": ("disk", 3), "distance_mm": (), "planned": ("plan", "disk", 3)},
    **{"actual": ("time", "disk", 3), "pusher": ("time", 2)},
}


def flaw(found: Mapping[str, Any], name: str) -> str | None:
    """Return why a record is invalid, or None if it is valid.

    Args:
        found: content of the file.
        name: name of the file without its suffix, the number of the trial.
    """
    for field, kind in _TYPES.items():
        if type(found.get(field)) is not kind:  # True is an int, too
            return _named(found, field, f"of type {kind.__name__}")
    if f"{found['trial']:03d}" != name:
        return f"trial is {found['trial']}, another episode"
    lengths: dict[str, int] = {}
    flawed = _misfit(found, _NUMBERS, lengths)
    flawed = flawed or _misfit(found, _PLACES, lengths, may_be_null=True)
    if flawed or not 0 <= found["moved"] < lengths["disk"]:
        return flawed or f"moved is {found['moved']} of {lengths['disk']} disks"
    for index, turn in enumerate(found["turns"]):
        known = turn if isinstance(turn, dict) else {}
        disks = {"disk": lengths["disk"]}
        if flawed := _misfit(known, _TURN_PLACES, disks, may_be_null=True):
            return f"turns[{index}].{flawed}"
    return None


def _misfit(
    found: Mapping[str, Any],
    shapes: Mapping[str, tuple[Axis, ...]],
    lengths: dict[str, int],
    *,
    may_be_null: bool = False,
) -> str | None:
    """Return the first field with a wrong shape, or None.

    Args:
        found: lists of numbers by name.
        shapes: required shapes by name.
        lengths: known lengths of axes; new lengths are added.
        may_be_null: whether null may replace a number.
    """
    for name, axes in shapes.items():
        values = np.asarray(found.get(name, "missing"), object)
        fits = _fits(values.shape, axes, lengths)
        numbers = (v for v in values.ravel() if not (may_be_null and v is None))
        if not fits or not all(map(is_number, numbers)):
            shape = f"numbers of shape [{', '.join(map(str, axes))}]"
            return _named(found, name, shape if axes else "a number")
    return None


def _fits(
    shape: tuple[int, ...], axes: tuple[Axis, ...], lengths: dict[str, int]
) -> bool:
    """Return whether a shape has these axes; new lengths are added."""
    return len(shape) == len(axes) and all(
        length == (axis if isinstance(axis, int) else lengths.setdefault(axis, length))
        for length, axis in zip(shape, axes, strict=True)
    )


def _named(found: Mapping[str, Any], name: str, wanted: str) -> str:
    if name not in found:
        return f"{name} is missing"
    return f"{name} is {str(found[name])[:40]!r} and not {wanted}"
