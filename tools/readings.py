"""What a table of results says, in sentences that are computed from it."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from sainet.viz.control_table import CHANCE
from sainet.viz.palette import styles_of

_PHYSICS, _CALIBRATED, _ALONE = "physics", "physics-calibrated", "in"
_ERRORS = {"pos_mm": "pos", "rot_deg": "rot"}

Row = Mapping[str, Any]


def of_control(table: Mapping[str, Any]) -> str:
    """Say where the choice of a model decides what is solved, and where it does not."""
    differing = {
        pair["group"]
        for pair in table["pairs"]
        if pair["measure"] == "solved" and pair["p"] < CHANCE
    }
    solved: dict[str, list[str]] = {}
    for row in table["rows"]:
        told = f"{_label(row['model'])} {row['solved']}"
        solved.setdefault(row["group"], []).append(told)
    level = "; ".join(group for group in solved if group not in differing)
    apart = [
        f"They do in *{group}*{_why(group)}: {'; '.join(solved[group])}."
        for group in solved
        if group in differing
    ]
    return " ".join(
        [
            f"No two models differ (p < {CHANCE:g}) in what they solve in: {level}.",
            *apart,
        ]
    )


def _why(group: str) -> str:
    if "three disks" not in group:
        return ""
    return ", more disks than the two that the networks were trained on"


def of_errors(table: Mapping[str, Any]) -> str:
    """Set a table of prediction errors in relation: to physics, published, to both.

    Args:
        table: of one group of pushes, with the paper's numbers (`published`).
    """
    lines = ["| Error over that of Physics | pos | rot |", "| :-- | --: | --: |"]
    lines += _ratios(table["rows"], "{}")
    lines += _ratios(table["published"], "*{}, published*")
    sains = [name for name in _models(table["rows"]) if name.startswith("sain")]
    against = [
        f"{_label(name)} is {_verdict(table['comparisons'], name, _CALIBRATED)}"
        for name in sains
    ]
    alone = [
        f"{_label(name)} is {_verdict(table['comparisons'], name, _ALONE)}"
        for name in sains
    ]
    said = (
        f"Calibrate or learn? Against {_label(_CALIBRATED)} (the 95 % interval of the "
        f"paired difference leaves out 0), {'; '.join(against)}. {_worth(table)}"
    )
    return "\n".join([*lines, "", said, "", f"Against IN, {'; '.join(alone)}."])


def _worth(table: Mapping[str, Any]) -> str:
    """Say what is left of physics' position error by knowing, learning, and both."""
    rows = table["rows"]
    left = {
        "true masses and radii alone leave": _CALIBRATED,
        "learning around wrong ones leaves": "sain",
        "learning around true ones leaves": "sain-calibrated",
    }
    parts = [
        f"{words} {_slashed(_over_physics(rows, name, 'pos_mm'))}"
        for words, name in left.items()
        if name in _models(rows)
    ]
    return f"Of the position error of Physics, {', '.join(parts)}."


def _ratios(rows: Sequence[Row], form: str) -> list[str]:
    return [
        f"| {form.format(_label(name))} | "
        + " | ".join(_slashed(_over_physics(rows, name, key)) for key in _ERRORS)
        + " |"
        for name in _models(rows)
        if name != _PHYSICS
    ]


def _over_physics(rows: Iterable[Row], model: str, key: str) -> list[float]:
    """Return a model's errors over those of physics, disk by disk."""
    errors = {(row["model"], row["body"]): row[key] for row in rows}
    bodies = sorted(body for name, body in errors if name == _PHYSICS)
    return [errors[model, body] / errors[_PHYSICS, body] for body in bodies]


def _verdict(comparisons: Iterable[Row], model: str, against: str) -> str:
    """Say in which errors a model is surely better or worse than another."""
    found: dict[str, list[str]] = {"better": [], "worse": []}
    for pair in comparisons:
        if (pair["model"], pair["against"]) != (model, against):
            continue
        if pair["metric"] not in _ERRORS:
            continue
        low, high = pair["interval"]
        place = f"{_ERRORS[pair['metric']]} of disk {pair['body']}"
        if high < 0:
            found["better"].append(place)
        if low > 0:
            found["worse"].append(place)
    told = [f"{word} in {', '.join(where)}" for word, where in found.items() if where]
    return " and ".join(told) or "neither better nor worse"


def _models(rows: Iterable[Row]) -> list[str]:
    return list(dict.fromkeys(str(row["model"]) for row in rows))


def _label(model: str) -> str:
    return styles_of([model])[model].label


def _slashed(values: Iterable[float]) -> str:
    return " / ".join(f"{value:.2f}" for value in values)
