"""Tables arranged from summaries: the content of each line and column.

A line for each model in each condition, a column for each metric and body, the best
model of a column marked, published numbers apart, and sentences below.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from sainet.evaluation.claims import LEVEL, TRUE_PROPERTIES
from sainet.evaluation.measurements import PublishedValues
from sainet.evaluation.metrics import METRICS, Metric
from sainet.evaluation.summary import BASELINE, Estimate, Row, Summary
from sainet.evaluation.trials import TrialRow
from sainet.models.identity import ModelId
from sainet.report.palette import labels_of
from sainet.report.table import DASH, Cell, Column, Line, Table
from sainet.report.verdicts import comparisons, trial_sentences, verdicts_on

# Means over the steps of a push, then its end: blocks of a terminal's width.
_STEPS = ("trans_percent", "pos_mm", "rot_deg")
_ENDS = ("final_pos_mm", "final_rot_deg", "relative_percent")
_TRIAL_HEADINGS = (
    *("solved", "success (95 %)", "pushes (median)"),
    *("within 25 pushes", "within 4 mm", "decision (s)"),
)
# Of trials in labs: means with intervals over labs and trials.
_OUTCOMES = {
    "within_2_mm": ("within 2 mm", "{:.0%}"),
    "overshoot_mm": ("overshoot (mm)", "{:.1f}"),
    "stuck": ("stuck", "{:.0%}"),
}


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
        return _arrange_trials(summary)
    every, notes = _without_twins(_by_line(summary, summary.rows), summary)
    theirs = [*_by_line(summary, summary.predictions), *_published(summary)]
    metrics = _used(every, theirs)
    bodies = tuple(sorted({body for each in every + theirs for body in each.bodies}))
    columns = tuple(Column(m.key, m.name, m.unit, bodies) for m in metrics)
    labels = labels_of(values.model for values in every + theirs)
    lines = [_line(values, metrics, bodies, labels) for values in every]
    return Table(
        columns=columns,
        lines=tuple(_mark_best(every, lines, metrics)),
        published=tuple(_line(v, metrics, bodies, labels, "") for v in theirs),
        notes=tuple(notes),
        sentences=tuple(comparisons(summary, {v.model.slug for v in every})),
        verdicts=verdicts_on(summary),
    )


def _by_line(summary: Summary, rows: Iterable[Row]) -> list[_Values]:
    models = {model.slug: model for model in summary.models}
    found: dict[tuple[str, str], _Values] = {}
    for row in rows:
        place = row.condition, row.model
        if place not in found:
            model = models[row.model]
            found[place] = _Values(row.condition, model, {}, row.count, row.trainings)
        found[place].bodies[row.body] = row.values
    order = [condition.label for condition in summary.conditions]
    return sorted(found.values(), key=lambda values: order.index(values.condition))


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
    """Leave out true-property physics where it makes no difference, with a note."""
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
    note = (
        f"{f'{where}: ' if where else ''}{names[TRUE_PROPERTIES]}, has the same errors "
        f"as {names[BASELINE]} and is left out: true masses and radii do not change "
        "these predictions."
    )
    return kept, [note]


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


def _arrange_trials(summary: Summary) -> Table:
    labels = labels_of([*summary.models, *(p.model for p in summary.published)])
    outcomes = {(e.condition, e.model): e.values for e in summary.outcomes}
    shown = _OUTCOMES if outcomes else {}
    headings = (*_TRIAL_HEADINGS, *(heading for heading, _ in shown.values()))

    def line(row: TrialRow) -> Line:
        values = outcomes.get((row.condition, row.model), {})
        cells = (_outcome(values[name], form) for name, (_, form) in shown.items())
        found = _trial_line(row, labels)
        return replace(found, cells=(*found.cells, *cells))

    return Table(
        columns=tuple(Column(heading, heading) for heading in headings),
        lines=tuple(map(line, summary.trials)),
        published=tuple(
            _published_trials(each, labels, len(headings)) for each in summary.published
        ),
        sentences=tuple(trial_sentences(summary)),
        verdicts=verdicts_on(summary),
        samples="Trials",
        note="",
    )


def _trial_line(row: TrialRow, labels: Mapping[str, str]) -> Line:
    low, high = row.interval
    texts = (
        f"{row.solved}/{row.trials}",
        f"{low:.0%}{DASH}{high:.0%}",
        DASH if row.median_pushes is None else f"{row.median_pushes:g}",
        f"{row.within_25_pushes:.0%}",
        f"{row.within_4_mm:.0%}",
        DASH if row.median_decision_s is None else f"{row.median_decision_s:.3f}",
    )
    cells = tuple(map(Cell, texts))
    return Line(row.condition, row.model, labels[row.model], cells)


def _outcome(estimate: Estimate, form: str) -> Cell:
    if estimate.value is None:
        return Cell(DASH)
    # None is negative; the widened interval of few labs may be.
    low, high = (form.format(max(x or 0.0, 0.0)) for x in (estimate.low, estimate.high))
    return Cell(form.format(estimate.value), f"{low}{DASH}{high}")


def _published_trials(
    each: PublishedValues, labels: Mapping[str, str], count: int
) -> Line:
    trials = each.trials or 0
    solved = f"{round((each.values['success'][0] or 0) * trials)}/{trials}"
    cells = (Cell(solved), *[Cell(DASH)] * (count - 1))
    slug = each.model.slug
    return Line(each.condition, slug, f"{labels[slug]}, published", cells)
