"""The error table for a terminal, for Markdown and for HTML.

A line for each model, columns for each disk, the best model of a column in bold,
intervals (95 %) in small or dim print, published numbers apart and in italics.
"""

import html
import re
from collections.abc import Mapping, Sequence
from typing import Any

from rich import box
from rich.console import Console
from rich.table import Table
from rich.text import Text

from sainet.report.pages.templates import render
from sainet.report.palette import styles_of
from sainet.report.rows import (
    METRICS,
    OVER_STEPS,
    Cell,
    ErrorTable,
    Line,
    Metric,
    arrange,
)

_NOTE = (
    "Small print: 95 % interval over pushes, and over trainings if there are several. "
    "Bold: the best of a column."
)
# What a terminal shows side by side: means over the steps, then the rest.
_ANY_WIDTH = 10_000  # characters
_BLOCKS = (OVER_STEPS, METRICS[len(OVER_STEPS) :])


def print_table(result: Mapping[str, Any], console: Console) -> None:
    """Print the table of an evaluation.

    A terminal too narrow for a column per disk gets ``disk 1 / disk 2``, as in the
    paper, without the intervals.
    """
    blocks = [arrange(result, metrics) for metrics in _BLOCKS]
    shown = [block for block in blocks if not block.is_empty]
    if not shown:
        console.print("Nothing to show: the evaluation has no numbers.")
        return
    unbounded = console.options.update(width=_ANY_WIDTH)
    for table in shown:
        wide = _rich_table(table, is_compact=False)
        fits = console.measure(wide, options=unbounded).maximum <= console.width
        console.print(wide if fits else _rich_table(table, is_compact=True))
    for sentence in shown[0].comparisons:
        console.print(Text(sentence))


def to_html(result: Mapping[str, Any]) -> str:
    """Return the table as an HTML fragment in which every string is escaped."""
    table = arrange(result)
    styles = styles_of(line.model for line in table.lines)
    return render("table.html.j2", table=table, styles=styles, note=_NOTE)


def to_markdown(result: Mapping[str, Any]) -> str:
    """Return the table as GitHub's Markdown, ``disk 1 / disk 2`` as in the paper."""
    table = arrange(result)
    if table.is_empty:
        return "Nothing to show: the evaluation has no numbers.\n"
    headings = ["Pushes"] if table.has_groups else []
    headings += ["Model", "n", *(metric.heading for metric in table.metrics)]
    rule = [":--"] * (len(headings) - 1 - len(table.metrics))
    rule += ["--:"] * (1 + len(table.metrics))
    rows = [headings, rule]
    rows += [_markdown_line(table, line, "") for line in table.lines]
    rows += [_markdown_line(table, line, "*") for line in table.published]
    text = "\n".join("| " + " | ".join(row) + " |" for row in rows)
    notes = [_markdown_note(table), *(f"- {_plain(s)}" for s in table.comparisons)]
    return f"{text}\n\n" + "\n".join(notes) + "\n"


def _rich_table(table: ErrorTable, *, is_compact: bool) -> Table:
    drawn = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    if table.has_groups:
        drawn.add_column("pushes", no_wrap=True)
    drawn.add_column("model", no_wrap=True)
    drawn.add_column("n", justify="right", no_wrap=True)
    for heading in _headings(table, is_compact):
        drawn.add_column(Text(heading), justify="right", no_wrap=True)
    cells_of = _compact_cells if is_compact else _full_cells
    for part, style in ((table.lines, ""), (table.published, "italic")):
        for line in part:
            names = _rich_names(table, line, bool(style))
            drawn.add_row(*names, *cells_of(table, line), style=style)
        drawn.add_section()
    return drawn


def _headings(table: ErrorTable, is_compact: bool) -> list[str]:
    disks = [f"disk {body}" for body in table.bodies]
    if is_compact:
        disks = ["disk " + "/".join(map(str, table.bodies))]
    return [f"{m.name}\n({m.unit})\n{disk}" for m in table.metrics for disk in disks]


def _full_cells(_: ErrorTable, line: Line) -> list[Text]:
    return [_rich_cell(cell, with_interval=True) for cell in line.cells]


def _compact_cells(table: ErrorTable, line: Line) -> list[Text]:
    slash = Text("/")
    return [
        slash.join(
            _rich_cell(cell, with_interval=False)
            for cell in table.cells_of(line, metric)
        )
        for metric in table.metrics
    ]


def _rich_names(table: ErrorTable, line: Line, is_published: bool) -> Sequence[Text]:
    """Return the first cells as plain text: a name may look like rich's markup."""
    count = "" if line.count is None else str(line.count)
    name = f"{line.label}, published" if is_published else line.label
    cells = [Text(name), Text(count)]
    return [Text(line.group), *cells] if table.has_groups else cells


def _rich_cell(cell: Cell, *, with_interval: bool) -> Text:
    text = Text(cell.text, style="bold" if cell.is_best else "")
    if with_interval and cell.interval:
        text.append(f"\n{cell.interval}", style="dim not bold")
    return text


def _markdown_line(table: ErrorTable, line: Line, slant: str) -> list[str]:
    count = "" if line.count is None else str(line.count)
    name = f"{line.label}, published" if slant else line.label
    cells = [_markdown_cell(table, line, metric, slant) for metric in table.metrics]
    row = [f"{slant}{_plain(name)}{slant}", count, *cells]
    return [_plain(line.group), *row] if table.has_groups else row


def _markdown_cell(table: ErrorTable, line: Line, metric: Metric, slant: str) -> str:
    cells = table.cells_of(line, metric)
    marks = ["**" if cell.is_best else slant for cell in cells]
    pairs = zip(cells, marks, strict=True)
    values = " / ".join(f"{mark}{cell.text}{mark}" for cell, mark in pairs)
    intervals = [cell.interval for cell in cells]
    small = f"<br><sub>{' / '.join(intervals)}</sub>" if any(intervals) else ""
    return values + small


def _markdown_note(table: ErrorTable) -> str:
    disks = " / ".join(f"disk {body}" for body in table.bodies)
    return f"Numbers: {disks}. {_NOTE}\n"


def _plain(text: str) -> str:
    """Return text in which nothing means anything to Markdown, HTML or a table."""
    single = " ".join(text.split())
    return re.sub(r"([\\`*_\[\]|~])", r"\\\1", html.escape(single, quote=False))
