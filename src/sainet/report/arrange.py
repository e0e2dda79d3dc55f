"""Tables arranged from summaries: what stands in which line and column.

A line for each model in each condition, a column for each metric and body, the best
model of a column marked, published numbers apart, and sentences below.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from sainet.evaluation.claims import LEVEL
from sainet.evaluation.metrics import METRICS, Metric
from sainet.evaluation.summary import BASELINE, Comparison, Estimate, Row, Summary
from sainet.models.identity import ModelId
from sainet.report.arrange_trials import arrange_trials
from sainet.report.palette import labels_of
from sainet.report.table import DASH, Cell, Column, Line, Table
from sainet.report.verdicts import verdicts_on

TRUE_PROPERTIES = "physics-true"
# Means over the steps of a push, then its end: blocks of a terminal's width.
_STEPS = ("trans_percent", "pos_mm", "rot_deg")
_ENDS = ("final_pos_mm", "final_rot_deg", "relative_percent")


@dataclass(frozen=True)
class _Values:
    """The numbers of one line, body by body."""

    condition: str
    model: ModelId
    bodies: dict[int, dict[str, Estimate]]
    count: int | None = None
    trainings: int = 1

    def estimate(self, metric: Metric, body: int) -> Estimate:
        return self.bodies.get(body, {}).get(metric.key, Estimate())


def arrange(summary: Summary) -> Table:
    """Return the table of a summary; columns without any number are left out."""
    if summary.is_of_trials:
        return arrange_trials(summary)
    every, notes = _without_twins([*_measured(summary)], summary)
    theirs = [*_predicted(summary), *_published(summary)]
    metrics = _used(every, theirs)
    bodies = tuple(
        sorted({body for values in every + theirs for body in values.bodies})
    )
    columns = tuple(Column(m.key, m.name, m.unit, bodies) for m in metrics)
    labels = labels_of(values.model for values in every + theirs)
    lines = [_line(values, metrics, bodies, labels) for values in every]
    return Table(
        columns=columns,
        lines=tuple(_mark_best(every, lines, metrics)),
        published=tuple(_line(v, metrics, bodies, labels, "") for v in theirs),
        sentences=(*notes, *_comparisons(summary, {v.model.slug for v in every})),
        verdicts=verdicts_on(summary),
    )


def _measured(summary: Summary) -> Iterator[_Values]:
    return _by_line(summary, summary.rows)


def _predicted(summary: Summary) -> Iterator[_Values]:
    return _by_line(summary, summary.predictions)


def _by_line(summary: Summary, rows: Iterable[Row]) -> Iterator[_Values]:
    models = {model.slug: model for model in summary.models}
    found: dict[tuple[str, str], _Values] = {}
    for row in rows:
        place = row.condition, row.model
        if place not in found:
            model = models[row.model]
            found[place] = _Values(row.condition, model, {}, row.count, row.trainings)
        found[place].bodies[row.body] = row.values
    order = [condition.label for condition in summary.conditions]
    return iter(
        sorted(found.values(), key=lambda values: order.index(values.condition))
    )


def _published(summary: Summary) -> Iterator[_Values]:
    for each in summary.published:
        bodies: dict[int, dict[str, Estimate]] = {}
        for key, values in each.values.items():
            for body, value in enumerate(values, start=1):
                bodies.setdefault(body, {})[key] = Estimate(value)
        yield _Values(each.condition, each.model, bodies)


def _without_twins(
    lines: list[_Values], summary: Summary
) -> tuple[list[_Values], list[str]]:
    """Leave out true-property physics where it makes no difference, and say so."""
    others = {line.condition: line for line in lines if line.model.slug == BASELINE}
    twins = [
        line
        for line in lines
        if line.model.slug == TRUE_PROPERTIES
        and line.condition in others
        and _are_alike(others[line.condition], line)
    ]
    kept = [line for line in lines if not any(line is twin for twin in twins)]
    if not twins:
        return kept, []
    names = labels_of(summary.models)
    where = ", ".join(twin.condition for twin in twins if twin.condition)
    told = (
        f"{f'{where}: ' if where else ''}{names[TRUE_PROPERTIES]}, has the same errors "
        f"as {names[BASELINE]} and is left out: true masses and radii do not change "
        "these predictions."
    )
    return kept, [told]


def _are_alike(one: _Values, other: _Values) -> bool:
    """Whether no error of two lines differs by more than rounding."""
    for body, values in other.bodies.items():
        for key, estimate in values.items():
            a, b = estimate.value, one.estimate(METRICS[key], body).value
            if a != b and (a is None or b is None or abs(a - b) > LEVEL * abs(a)):
                return False
    return True


def _used(ours: list[_Values], theirs: list[_Values]) -> list[Metric]:
    """Return the metrics that have a number, in the order of the table."""
    shown = [METRICS[key] for key in (*_STEPS, *_ENDS)]
    shown += [metric for key, metric in METRICS.items() if key not in (*_STEPS, *_ENDS)]
    if _are_ends(ours):  # a mean over steps is the end once more
        shown = [metric for metric in shown if metric.is_of_end]
    return [
        metric
        for metric in shown
        if any(
            values.estimate(metric, body).value is not None
            for values in ours + theirs
            for body in values.bodies
        )
    ]


def _are_ends(lines: Sequence[_Values]) -> bool:
    """Whether the ends of pushes were observed and nothing else."""
    ends = [
        [line.estimate(METRICS[key], body).value for key in ("pos_mm", "final_pos_mm")]
        for line in lines
        for body in line.bodies
    ]
    return bool(ends) and all(one is not None and one == two for one, two in ends)


def _line(
    values: _Values,
    metrics: Sequence[Metric],
    bodies: Sequence[int],
    labels: Mapping[str, str],
    addition: str | None = None,
) -> Line:
    label = labels[values.model.slug]
    if addition is not None:
        label += ", published"
    elif values.trainings > 1:
        label += f" (mean of {values.trainings})"
    cells = [_cell(values.estimate(m, body), m) for m in metrics for body in bodies]
    slug = values.model.slug
    return Line(values.condition, slug, label, tuple(cells), values.count)


def _cell(estimate: Estimate, metric: Metric) -> Cell:
    if estimate.value is None:
        return Cell(DASH)
    low, high = estimate.low, estimate.high
    interval = ""
    if low is not None and high is not None:
        interval = f"{low:.{metric.digits}f}{DASH}{high:.{metric.digits}f}"
    return Cell(f"{estimate.value:.{metric.digits}f}", interval)


def _mark_best(
    values: Sequence[_Values], lines: Sequence[Line], metrics: Sequence[Metric]
) -> Iterator[Line]:
    """Mark the best number of each column within each condition of several models."""
    directions = [m.direction for m in metrics]
    for line in lines:
        rivals = [other for other in lines if other.condition == line.condition]
        if len(rivals) == 1 or not metrics:
            yield line
            continue
        bodies = len(line.cells) // len(metrics)
        cells = tuple(
            replace(cell, is_best=_is_best(cell, column, directions[place // bodies]))
            for place, (cell, *column) in enumerate(
                zip(line.cells, *(rival.cells for rival in rivals), strict=True)
            )
        )
        yield replace(line, cells=cells)


def _is_best(cell: Cell, column: Sequence[Cell], direction: str) -> bool:
    """Whether no other number of the column reads better."""
    known = [float(other.text) for other in column if other.text != DASH]
    if cell.text == DASH or not known:
        return False
    best = min(known) if direction == "less" else max(known)
    return float(cell.text) == best


def _comparisons(summary: Summary, shown: set[str]) -> Iterator[str]:
    """Yield by how much each model differs from another, a sentence for each pair."""
    labels = labels_of(summary.models)
    pairs: dict[tuple[str, str, str], dict[str, list[Comparison]]] = {}
    for each in _worth_showing(summary, shown):
        found = pairs.setdefault((each.condition, each.model, each.against), {})
        found.setdefault(each.metric, []).append(each)
    for (condition, model, against), metrics in pairs.items():
        amounts = "; ".join(
            f"{METRICS[key].name} {' / '.join(map(_difference, rows))} "
            f"{METRICS[key].unit}"
            for key, rows in metrics.items()
        )
        where = f"{condition}: " if condition else ""
        yield f"{where}{labels[model]} minus {labels[against]}: {amounts}"


def _worth_showing(summary: Summary, shown: set[str]) -> list[Comparison]:
    """Return the comparisons that a reader needs; the JSON contains all.

    Beside true-property physics a comparison with physics adds little, and the end of
    a push repeats its mean; where nothing else was compared, these are kept.
    """
    hidden = "" if TRUE_PROPERTIES in shown else TRUE_PROPERTIES
    every = [e for e in summary.comparisons if hidden not in (e.model, e.against)]
    less = BASELINE if TRUE_PROPERTIES in shown else ""
    steps = [each for each in every if not METRICS[each.metric].is_of_end]
    return [each for each in steps if each.against != less] or steps or every


def _difference(comparison: Comparison) -> str:
    low, high = comparison.difference.low, comparison.difference.high
    interval = f" [{_signed(low)}, {_signed(high)}]" if low is not None else ""
    return _signed(comparison.difference.value) + interval


def _signed(value: float | None) -> str:
    return DASH if value is None else f"{value:+.3f}".replace("-", "−")  # noqa: RUF001
