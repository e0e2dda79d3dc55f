"""Complete tables of every page of results: HTML that sorts, and CSV.

They are made from the stored results when the site is built: see `docs/results/`.
"""

import csv
import html
import io
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import compress
from pathlib import Path

from sainet.evaluation.intervals import Estimate
from sainet.evaluation.metrics import METRICS
from sainet.evaluation.summary import Summary
from sainet.report.palette import labels_of
from sainet.report.verdicts import verdicts_on
from sainet.studies import STUDIES, load_study
from sainet.studies.pages import PAGES

Value = str | int | float | None | Estimate
NAMED = re.compile(r"`tables/([\w-]+)\.(?:html|csv)`")


@dataclass(frozen=True)
class Column:
    """A quantity, or what it is of."""

    heading: str
    digits: int = 3  # of estimates after the point, on the page; the CSV has six in all


@dataclass(frozen=True)
class Grid:
    """A complete table: a value or an estimate in each cell.

    Attributes:
        suffix: of its CSV, after the name of the study.
        caption: for readers.
        columns: its columns.
        rows: a value for each column.
    """

    suffix: str
    caption: str
    columns: Sequence[Column]
    rows: Sequence[Sequence[Value]]

    def to_csv(self) -> str:
        """Return it as CSV: an estimate in three columns, its value and its ends."""
        wide = [_has_estimates(column) for column in zip(*self.rows, strict=True)]
        stream = io.StringIO()
        writer = csv.writer(stream, lineterminator="\n")
        ends = ("", " low", " high")
        writer.writerow(
            f"{column.heading}{end}"
            for column, is_wide in zip(self.columns, wide, strict=True)
            for end in (ends if is_wide else ends[:1])
        )
        for row in self.rows:
            cells = zip(row, wide, strict=True)
            writer.writerow(text for each in cells for text in _texts(*each))
        return stream.getvalue()

    def to_html(self) -> str:
        """Return it as an HTML table whose headings are buttons that sort."""
        heads = "".join(
            f'<th scope="col"><button type="button">{html.escape(c.heading)}</button>'
            "</th>"
            for c in self.columns
        )
        rows = "\n".join(
            f"<tr>{''.join(map(_cell, row, self.columns))}</tr>" for row in self.rows
        )
        caption = html.escape(self.caption)
        return (
            '<div class="complete" tabindex="0" role="region" '
            f'aria-label="{caption}">\n'
            f'<table class="docutils sortable">\n<caption>{caption}</caption>\n'
            f"<thead><tr>{heads}</tr></thead>\n<tbody>\n{rows}\n</tbody>\n"
            "</table>\n</div>\n"
        )


def _has_estimates(values: Iterable[Value]) -> bool:
    return any(isinstance(value, Estimate) for value in values)


def _texts(value: Value, is_wide: bool) -> Iterator[str]:  # noqa: FBT001
    parts = (value.value, value.low, value.high) if isinstance(value, Estimate) else ()
    for part in parts or (value, *([None, None] if is_wide else [])):
        yield "" if part is None else _number(part)


def _number(value: Value) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def _cell(value: Value, column: Column) -> str:
    if isinstance(value, Estimate):
        low, high = value.low, value.high
        ends = (_shown(low, column), _shown(high, column))
        small = f" <small>{' to '.join(ends)}</small>" if low is not None else ""
        text = f"{_shown(value.value, column)}{small}"
        return f'<td data-value="{_raw(value.value)}">{text}</td>'
    if isinstance(value, int | float):
        text = str(value) if isinstance(value, int) else f"{value:.3g}"
        return f'<td data-value="{_raw(value)}">{text}</td>'
    return f"<td>{html.escape(value or '')}</td>"


def _raw(value: float | None) -> str:
    return "" if value is None else repr(value)


def _shown(value: float | None, column: Column) -> str:
    if value is None:
        return ""
    return f"{value:.{column.digits}f}".replace("-", "−")  # noqa: RUF001


def named_tables(folder: Path) -> dict[str, tuple[str, str]]:
    """Return the tables that pages of results name: the page and its title.

    Args:
        folder: of the site's sources.
    """
    found: dict[str, tuple[str, str]] = {}
    for page in sorted((folder / Path(PAGES).name).glob("*.md")):
        text = page.read_text("utf-8")
        title = text.partition("\n")[0].removeprefix("# ")
        for name in NAMED.findall(text):
            found.setdefault(name, (page.stem, title))
    return found


def body(name: str, page: str, title: str, summary: Summary) -> str:
    """Return the body of the page of complete tables.

    Args:
        name: of the measurements.
        page: of the results, that names them.
        title: of that page.
        summary: of the measurements.
    """
    verdicts = "".join(f"<p>{html.escape(v)}</p>\n" for v in verdicts_on(summary))
    parts = [
        f"<h1>Every number: {html.escape(title)}</h1>\n"
        f'<p>All numbers behind the page <a href="../{page}.html">{html.escape(title)}'
        "</a>. Click a heading to sort by its column; click again to reverse the "
        "order.</p>\n"
        "<p><label>Show rows that contain "
        '<input type="search" class="filter"></label></p>\n'
    ]
    for grid in grids(name, summary):
        file = f"{name}{grid.suffix}.csv"
        parts.append(f'{grid.to_html()}<p><a href="{file}" download>{file}</a></p>\n')
    return (
        "".join([*parts, verdicts]) + '<script src="../../_static/sort.js"></script>\n'
    )


def grids(name: str, summary: Summary) -> Iterator[Grid]:
    """Yield the complete tables of measurements, none of them empty.

    Args:
        name: of the measurements.
        summary: of them.
    """
    labels = labels_of(summary.models)
    every = (
        _errors(summary),
        _trials(summary, labels),
        _comparisons(summary, labels),
        _tests(summary, labels),
        _differences(summary, labels),
        _choices(name, summary),
    )
    yield from (_without_empty(grid) for grid in every if grid.rows)


def _without_empty(grid: Grid) -> Grid:
    """Return a table without the columns that are empty in each row."""
    filled = [
        any(value not in ("", None) for value in c)
        for c in zip(*grid.rows, strict=True)
    ]
    rows = [list(compress(row, filled)) for row in grid.rows]
    return replace(grid, columns=list(compress(grid.columns, filled)), rows=rows)


def _errors(summary: Summary) -> Grid:
    """Return every error: a row for each model in each condition."""
    models = {model.slug: model for model in summary.models}
    bodies = sorted({row.body for row in (*summary.rows, *summary.predictions)})
    known = {key for row in (*summary.rows, *summary.predictions) for key in row.values}
    keys = [key for key in METRICS if key in known]
    lines: dict[tuple[str, str, str], list[Value]] = {}
    cells: dict[tuple[str, str, str], dict[tuple[str, int], Estimate]] = {}
    for origin, rows in (("", summary.rows), ("published", summary.predictions)):
        for row in rows:
            place = row.condition, row.model, origin
            label = models[row.model].label
            lines[place] = [row.condition, label, origin, row.count, row.trainings]
            values = cells.setdefault(place, {})
            values |= {(key, row.body): each for key, each in row.values.items()}
    for each in summary.published if keys else ():
        place = each.condition, each.model.slug, "published"
        lines[place] = [each.condition, each.model.label, "published", None, None]
        cells[place] = {
            (key, body): Estimate(value)
            for key, values in each.values.items()
            for body, value in enumerate(values, start=1)
        }
    columns = [(key, body) for key in keys for body in bodies]
    headings = ("pushes", "model", "from", "number of pushes", "training runs")
    return Grid(
        "",
        "Errors",
        [*map(Column, headings), *(_error_column(*each) for each in columns)],
        [
            [*line, *(cells[place].get(each) for each in columns)]
            for place, line in lines.items()
        ],
    )


def _error_column(key: str, body: int) -> Column:
    metric = METRICS[key]
    return Column(f"{metric.name} ({metric.unit}), disk {body}", metric.digits)


def _trials(summary: Summary, labels: dict[str, str]) -> Grid:
    """Return every number of trials: a row for each model in each condition."""
    found = {(e.condition, e.model): e.values for e in summary.outcomes}
    outcomes = list(dict.fromkeys(key for values in found.values() for key in values))
    rows: list[list[Value]] = [
        [
            *(row.condition, labels[row.model], "", row.solved, row.trials),
            Estimate(row.success, *row.interval),
            *(row.median_pushes, row.within_25_pushes, row.within_4_mm),
            *(row.median_final_mm, row.median_decision_s, row.ended_early),
            *(found.get((row.condition, row.model), {}).get(key) for key in outcomes),
        ]
        for row in summary.trials
    ]
    headings = (
        *("goals", "model", "from", "solved", "trials", "success"),
        *("pushes, median of solved trials", "within 25 pushes", "within 4 mm"),
        *("final distance (mm), median", "decision (s), median", "ended early"),
        *(f"{key.replace('_', ' ')}, mean over labs" for key in outcomes),
    )
    if rows:
        rest = [None] * (len(headings) - 6)
        rows += [
            [
                *(each.condition, each.model.label, "published", None, each.trials),
                *(Estimate(value) for value in each.values["success"]),
                *rest,
            ]
            for each in summary.published
        ]
    return Grid("", "Trials", [*map(Column, headings)], rows)


def _comparisons(summary: Summary, labels: dict[str, str]) -> Grid:
    """Return every paired difference of two models: the first minus the other."""
    headings = ("pushes", "model", "minus", "error", "disk", "difference", "p")
    rows = [
        [
            *(each.condition, labels[each.model], labels[each.against]),
            f"{METRICS[each.metric].name} ({METRICS[each.metric].unit})",
            *(each.body, each.difference, each.p),
        ]
        for each in summary.comparisons
    ]
    caption = "Differences of models on the same pushes"
    return Grid("-comparisons", caption, [*map(Column, headings)], rows)


def _tests(summary: Summary, labels: dict[str, str]) -> Grid:
    """Return every paired test."""
    headings = ("goals", "measure", "model", "against", "only the first")
    rows = [
        [
            *(each.condition, each.measure.replace("_", " ")),
            *(labels[each.model], labels[each.against]),
            *(each.only_one, each.only_other, each.p),
        ]
        for each in summary.tests
    ]
    columns = [*map(Column, (*headings, "only the other", "p"))]
    return Grid("-tests", "Paired tests on the same goals", columns, rows)


def _differences(summary: Summary, labels: dict[str, str]) -> Grid:
    """Return every difference of means over labs."""
    headings = ("goals", "measure", "model", "minus", "difference")
    rows = [
        [
            *(each.condition, each.measure.replace("_", " ")),
            *(labels[each.model], labels[each.against], each.difference),
        ]
        for each in summary.differences
    ]
    caption = "Differences of means over labs"
    return Grid("-differences", caption, [*map(Column, headings)], rows)


def _choices(name: str, summary: Summary) -> Grid:
    """Return every setting that a study tried."""
    tried = load_study(name).choose(summary) if name in STUDIES else ()
    cells = [each.cells for each in tried]
    headings = list(dict.fromkeys(key for each in cells for key in each))
    rows = [[each.get(key) for key in headings] for each in cells]
    return Grid("-settings", "Settings tried", [*map(Column, headings)], rows)
