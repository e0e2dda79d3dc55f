"""The rows of an evaluation put in order: a line for each model, a column a number.

`result` is everywhere the JSON object of ``sainet evaluate --json``.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from sainet.report.palette import styles_of

DASH = "–"  # noqa: RUF001  (an en dash stands for a missing number)


@dataclass(frozen=True)
class Metric:
    """One error: the key in a row, its name and its unit."""

    key: str
    name: str
    unit: str
    digits: int = 2  # after the point

    @property
    def heading(self) -> str:
        """The name with its unit."""
        return f"{self.name} ({self.unit})"


OVER_STEPS = (
    Metric("trans_percent", "trans", "%"),
    Metric("pos_mm", "pos", "mm"),
    Metric("rot_deg", "rot", "deg"),
)
METRICS = (
    *OVER_STEPS,
    Metric("final_pos_mm", "final pos", "mm"),
    Metric("final_rot_deg", "final rot", "deg"),
    Metric("relative_percent", "pos/travel", "%", 1),
)


@dataclass(frozen=True)
class Cell:
    """One number with its interval; each part None where it is unknown."""

    value: float | None = None
    low: float | None = None
    high: float | None = None
    digits: int = 2
    is_best: bool = False

    @property
    def text(self) -> str:
        """The number, or a dash."""
        return DASH if self.value is None else f"{self.value:.{self.digits}f}"

    @property
    def interval(self) -> str:
        """The interval, or nothing."""
        if self.low is None or self.high is None:
            return ""
        return f"{self.low:.{self.digits}f}{DASH}{self.high:.{self.digits}f}"


@dataclass(frozen=True)
class Line:
    """One model on one group of pushes."""

    group: str  # empty: all pushes
    model: str
    label: str
    count: int | None  # pushes
    cells: tuple[Cell, ...]  # metric by metric, in each the bodies in order


@dataclass(frozen=True)
class ErrorTable:
    """Everything that a table shows, whatever it is rendered with."""

    metrics: tuple[Metric, ...]
    bodies: tuple[int, ...]  # 1-based
    lines: tuple[Line, ...]
    published: tuple[Line, ...]
    comparisons: tuple[str, ...]

    @property
    def is_empty(self) -> bool:
        """Whether there is no number to show."""
        return not self.metrics

    @property
    def has_groups(self) -> bool:
        """Whether any line tells of a part of the pushes."""
        return any(line.group for line in self.lines + self.published)

    def cells_of(self, line: Line, metric: Metric) -> tuple[Cell, ...]:
        """Return a line's cells of one metric, a cell for each body."""
        start = self.metrics.index(metric) * len(self.bodies)
        return line.cells[start : start + len(self.bodies)]


def arrange(
    result: Mapping[str, Any], metrics: Sequence[Metric] = METRICS
) -> ErrorTable:
    """Return the table of a result; metrics without any number are left out."""
    ours: list[Mapping[str, Any]] = list(result.get("rows") or ())
    theirs: list[Mapping[str, Any]] = list(result.get("published") or ())
    repeated = OVER_STEPS if _are_ends_alone(ours) else ()
    used = tuple(
        metric
        for metric in metrics
        if metric not in repeated
        and any(_number(row.get(metric.key)) is not None for row in ours + theirs)
    )
    bodies = tuple(sorted({int(row["body"]) for row in ours + theirs}))
    labels = {
        name: style.label
        for name, style in styles_of(str(row["model"]) for row in ours + theirs).items()
    }
    return ErrorTable(
        metrics=used,
        bodies=bodies,
        lines=tuple(_mark_best(_lines(ours, used, bodies, labels))),
        published=tuple(filter(_has_numbers, _lines(theirs, used, bodies, labels))),
        comparisons=_sentences(_worth_saying(result), labels),
    )


def _are_ends_alone(rows: Sequence[Mapping[str, Any]]) -> bool:
    """Whether the ends alone of pushes were observed: a mean over steps is the end."""
    keys = ("pos_mm", "final_pos_mm")
    ends = [tuple(_number(row.get(key)) for key in keys) for row in rows]
    return bool(ends) and all(one is not None and one == other for one, other in ends)


def _worth_saying(result: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """Return the comparisons that a reader has to see; the JSON holds them all.

    Beside physics that knows masses and radii, a comparison with physics that does not
    tells little, and the end of a push tells what its mean tells; where nothing else
    was compared, these are kept.
    """
    every: list[Mapping[str, Any]] = list(result.get("comparisons") or ())
    models = {row["model"] for row in result.get("rows") or ()}
    told_little = {"physics"} if "physics-true" in models else set()
    telling = [
        each
        for each in every
        if each["against"] not in told_little and not _is_of_end(each)
    ]
    return telling or [e for e in every if not _is_of_end(e)] or every


def _is_of_end(comparison: Mapping[str, Any]) -> bool:
    return str(comparison["metric"]).startswith("final")


def _lines(
    rows: list[Mapping[str, Any]],
    metrics: tuple[Metric, ...],
    bodies: tuple[int, ...],
    labels: Mapping[str, str],
) -> list[Line]:
    found: dict[tuple[str, str], dict[int, Mapping[str, Any]]] = {}
    for row in rows:
        place = str(row.get("group") or ""), str(row["model"])
        found.setdefault(place, {})[int(row["body"])] = row
    lines = []
    for (group, model), by_body in found.items():
        cells = tuple(
            _cell(by_body.get(body, {}), metric)
            for metric in metrics
            for body in bodies
        )
        any_row = next(iter(by_body.values()))
        trainings = any_row.get("trainings") or 1
        label = labels[model] + (f" (mean of {trainings})" if trainings > 1 else "")
        lines.append(Line(group, model, label, any_row.get("n"), cells))
    # Stable: groups stay together, models keep the order in which they were given.
    order = {line.group: rank for rank, line in reversed(list(enumerate(lines)))}
    return sorted(lines, key=lambda line: order[line.group])


def _has_numbers(line: Line) -> bool:
    return any(cell.value is not None for cell in line.cells)


def _cell(row: Mapping[str, Any], metric: Metric) -> Cell:
    low, high = row.get(f"{metric.key}_interval") or (None, None)
    value = _number(row.get(metric.key))
    return Cell(value, _number(low), _number(high), metric.digits)


def _number(value: object) -> float | None:
    """Return a finite number, or None for anything else."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    return float(value) if math.isfinite(value) else None


def _mark_best(lines: list[Line]) -> Iterable[Line]:
    """Mark the smallest number of each column within each group of several models."""
    for line in lines:
        rivals = [other for other in lines if other.group == line.group]
        if len(rivals) == 1:
            yield line
            continue
        columns = zip(*(rival.cells for rival in rivals), strict=True)
        cells = tuple(
            replace(cell, is_best=_is_best(cell, column))
            for cell, column in zip(line.cells, columns, strict=True)
        )
        yield replace(line, cells=cells)


def _is_best(cell: Cell, column: Sequence[Cell]) -> bool:
    """Whether no other number of the column reads smaller."""
    known = [other for other in column if other.value is not None]
    least = min(known, key=lambda other: other.value or 0.0, default=None)
    return least is not None and cell.text == least.text


def _sentences(
    comparisons: Sequence[Mapping[str, Any]], labels: Mapping[str, str]
) -> tuple[str, ...]:
    """Say by how much each model differs from another, a sentence for each pair."""
    pairs: dict[tuple[str, str, str], dict[str, list[Mapping[str, Any]]]] = {}
    for each in comparisons:
        names = (str(each[side]) for side in ("model", "against"))
        place = str(each.get("group") or ""), *names
        found = pairs.setdefault(place, {})  # type: ignore[arg-type]
        found.setdefault(str(each["metric"]), []).append(each)
    return tuple(
        (f"{group}: " if group else "")
        + f"{labels.get(model, model)} minus {labels.get(against, against)}: "
        + "; ".join(_amounts(key, rows) for key, rows in metrics.items())
        for (group, model, against), metrics in pairs.items()
    )


def _amounts(key: str, rows: Sequence[Mapping[str, Any]]) -> str:
    """Return the differences of one metric, disk by disk as in a line of the table."""
    metric = next((m for m in METRICS if m.key == key), Metric(key, key, ""))
    ordered = sorted(rows, key=lambda row: int(row["body"]))
    amounts = " / ".join(_difference(row) for row in ordered)
    return f"{metric.name} {amounts} {metric.unit}".strip()


def _difference(row: Mapping[str, Any]) -> str:
    low, high = row.get("interval") or (None, None)
    interval = f" [{_signed(low)}, {_signed(high)}]" if low is not None else ""
    return _signed(row["difference"]) + interval


def _signed(value: object) -> str:
    number = _number(value)
    return DASH if number is None else f"{number:+.3f}".replace("-", "−")  # noqa: RUF001
