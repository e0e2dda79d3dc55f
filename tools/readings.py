"""What a table of results says, in sentences that are computed from it."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from sainet.report.control_table import CHANCE
from sainet.report.palette import styles_of

_PHYSICS, _CALIBRATED, _ALONE = "physics", "physics-true", "in"
_BYSTANDER = "-bystander"
ERRORS = {"pos_mm": "pos", "rot_deg": "rot"}
FINAL_ERRORS = {"final_pos_mm": "final pos", "final_rot_deg": "final rot"}
_PUBLISHED = ("physics", "in", "sain-bullet")  # the paper's rows, as we name them

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
        f"They differ in *{group}*{_why(group)}: {'; '.join(solved[group])}."
        for group in solved
        if group in differing
    ]
    told = f"No two models differ (p < {CHANCE:g}) in what they solve in: {level}."
    return " ".join([*([told] if level else []), *apart])


def _why(group: str) -> str:
    if "three disks" not in group:
        return ""
    return ", more disks than the two that the networks were trained on"


def of_errors(table: Mapping[str, Any]) -> str:
    """Set a table of prediction errors in relation: to physics, published, to both.

    Args:
        table: of one group of pushes, with the paper's numbers (`published`).
    """
    rows, comparisons = table["rows"], table["comparisons"]
    lines = ["| Error over that of Physics | pos | rot |", "| :-- | --: | --: |"]
    lines += _ratios(rows, "{}")
    lines += _ratios(table["published"], "*{}, published*")
    sains = [name for name in _models(rows) if name.startswith("sain")]
    verdicts = [
        f"Against {_label(against)}, {_verdicts(comparisons, sains, against)}."
        for against in (_CALIBRATED, _ALONE)
    ]
    parts = [
        "\n".join(lines),
        _beside_the_paper(table),
        f"Calibrate or learn? {verdicts[0]} {_worth(rows)}",
        verdicts[1],
        *_beside_bystanders(table),
        _chance(comparisons),
    ]
    return "\n\n".join(parts)


def _beside_bystanders(table: Mapping[str, Any]) -> list[str]:
    """Say what going on beside a bystander gave, and cost where there is none."""
    taught = [name for name in _models(table["rows"]) if name.endswith(_BYSTANDER)]
    if not taught:
        return []
    said = []
    for part, where in ((table, "here"), (table["as_trained"], "on two disks")):
        verdicts = "; ".join(
            f"{_label(name)} is "
            + _verdict(part["comparisons"], name, name.removesuffix(_BYSTANDER))
            for name in taught
        )
        said.append(f"Against the network that it goes on from, {where}: {verdicts}.")
    lines = ["| On two disks, error over that of Physics | pos | rot |"]
    lines += ["| :-- | --: | --: |", *_ratios(table["as_trained"]["rows"], "{}")]
    return [*said, "\n".join(lines)]


def of_groups(
    table: Mapping[str, Any],
    against: Mapping[str, Sequence[str]] | None = None,
    errors: Mapping[str, str] = ERRORS,
) -> str:
    """Set errors of several groups of pushes in relation to physics and each other.

    Args:
        table: of the errors.
        against: the models that each model is compared with; by default every SAIN
            with physics-true and IN.
        errors: that are compared, and what they are called.
    """
    rows, comparisons = table["rows"], table["comparisons"]
    models = [name for name in _models(rows) if name != _PHYSICS]
    if against is None:
        sains = [name for name in models if name.startswith("sain")]
        against = dict.fromkeys(sains, (_CALIBRATED, _ALONE))
    groups = list(dict.fromkeys(row["group"] for row in rows))
    parts = [
        _ratios_by_group(rows, groups, models, key, name)
        for key, name in (("pos_mm", "Position"), ("rot_deg", "Rotation"))
    ]
    said = [
        f"- {f'*{group}*: ' if group else ''}{_label(model)} against {_label(other)}: "
        f"{_verdict(_of_group(comparisons, group), model, other, errors)}."
        for group in groups
        for model, others in against.items()
        for other in others
    ]
    return "\n\n".join([*parts, "\n".join(said), _chance(comparisons, errors)])


def _ratios_by_group(
    rows: Sequence[Row],
    groups: Sequence[str | None],
    models: Sequence[str],
    key: str,
    name: str,
) -> str:
    """Return a table of errors over those of physics: a line for each group."""
    labels = " | ".join(map(_label, models))
    lines = [f"| {name} error over that of Physics | {labels} |"]
    lines.append("| :-- |" + " --: |" * len(models))
    for group in groups:
        part = _of_group(rows, group)
        cells = [_slashed(_over_physics(part, model, key)) for model in models]
        lines.append(f"| {group or 'all'} | {' | '.join(cells)} |")
    return "\n".join(lines)


def _beside_the_paper(table: Mapping[str, Any]) -> str:
    """Say how our errors stand to the published ones, and whether the order holds."""
    rows, published = table["rows"], table["published"]
    ours = [name for name in _PUBLISHED if name in _models(rows)]
    theirs = {name: name.removesuffix("-bullet") for name in ours}
    shares = []
    for name in ours:
        ratios = {k: _over(rows, name, published, theirs[name], k) for k in ERRORS}
        told = ", ".join(f"{ERRORS[k]} {_slashed(v)}" for k, v in ratios.items())
        shares.append(f"{_label(name)} {told}")
    broken = [
        (key, body)
        for key in ERRORS
        for body, errors in enumerate(
            zip(*(_errors(rows, name, key) for name in ours), strict=True), start=1
        )
        if list(errors) != sorted(errors, reverse=True)
    ]
    order = ", ".join(_label(name) for name in reversed(ours))
    holds = f"does not hold in {_places(broken)}" if broken else "holds everywhere"
    return (
        f"Errors here over the published ones: {'; '.join(shares)}. The paper's order "
        f"of means ({order}, from small to large) {holds}."
    )


def _worth(rows: Sequence[Row]) -> str:
    """Say what is left of physics' position error by knowing, learning, and both."""
    left = {
        "true masses and radii in Bullet leave": _CALIBRATED,
        "learning around Bullet with wrong ones leaves": "sain-bullet",
        "learning around planar with wrong ones leaves": "sain",
        "learning around planar with true ones leaves": "sain-true",
    }
    parts = [
        f"{words} {_slashed(_over_physics(rows, name, 'pos_mm'))}"
        for words, name in left.items()
        if name in _models(rows)
    ]
    return f"Of the position error of Physics (Bullet), {', '.join(parts)}."


def _ratios(rows: Sequence[Row], form: str) -> list[str]:
    return [
        f"| {form.format(_label(name))} | "
        + " | ".join(_slashed(_over_physics(rows, name, key)) for key in ERRORS)
        + " |"
        for name in _models(rows)
        if name != _PHYSICS
    ]


def _over_physics(rows: Sequence[Row], model: str, key: str) -> list[float]:
    return _over(rows, model, rows, _PHYSICS, key)


def _over(
    rows: Sequence[Row], model: str, others: Sequence[Row], other: str, key: str
) -> list[float]:
    """Return a model's errors over those of another, disk by disk."""
    pairs = zip(_errors(rows, model, key), _errors(others, other, key), strict=True)
    return [one / two for one, two in pairs]


def _errors(rows: Iterable[Row], model: str, key: str) -> list[float]:
    found = {row["body"]: row[key] for row in rows if row["model"] == model}
    return [found[body] for body in sorted(found)]


def _of_group(rows: Iterable[Row], group: str | None) -> list[Row]:
    return [row for row in rows if row["group"] == group]


def _verdicts(comparisons: Sequence[Row], models: Iterable[str], against: str) -> str:
    return "; ".join(
        f"{_label(name)} is {_verdict(comparisons, name, against)}" for name in models
    )


def _verdict(
    comparisons: Iterable[Row],
    model: str,
    against: str,
    errors: Mapping[str, str] = ERRORS,
) -> str:
    """Say in which errors a model is surely better or worse than another."""
    found: dict[str, list[tuple[str, int]]] = {"better": [], "worse": []}
    for pair in comparisons:
        if (pair["model"], pair["against"]) != (model, against):
            continue
        if pair["metric"] not in errors:
            continue
        low, high = pair["interval"]
        place = pair["metric"], pair["body"]
        if high < 0:
            found["better"].append(place)
        if low > 0:
            found["worse"].append(place)
    told = [
        f"{word} in {_places(where, errors)}" for word, where in found.items() if where
    ]
    return " and ".join(told) or "neither better nor worse"


def _places(
    found: Sequence[tuple[str, int]], errors: Mapping[str, str] = ERRORS
) -> str:
    """Say which errors, of which disks: "pos of disks 1 and 2, rot of disk 1"."""
    told = []
    for key, name in errors.items():
        bodies = [str(body) for metric, body in found if metric == key]
        if bodies:
            *first, last = bodies
            disks = f"disks {', '.join(first)} and {last}" if first else f"disk {last}"
            told.append(f"{name} of {disks}")
    return ", ".join(told)


def _chance(comparisons: Iterable[Row], errors: Mapping[str, str] = ERRORS) -> str:
    count = sum(pair["metric"] in errors for pair in comparisons)
    return (
        "Better and worse: the 95 % interval of the paired difference leaves out 0. "
        "Where models do not differ, one in twenty does so by chance, and this table "
        f"has {count}."
    )


def _models(rows: Iterable[Row]) -> list[str]:
    return list(dict.fromkeys(str(row["model"]) for row in rows))


def _label(model: str) -> str:
    return styles_of([model])[model].label


def _slashed(values: Iterable[float]) -> str:
    return " / ".join(f"{value:.2f}" for value in values)
