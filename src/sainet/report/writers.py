"""Five writers of tables: terminal, Markdown, HTML, LaTeX and CSV. They print cells."""

import csv
import html
import io
import re
from collections.abc import Iterator, Sequence
from itertools import chain
from pathlib import Path

from rich import box
from rich.console import Console
from rich.table import Table as RichTable
from rich.text import Text

from sainet.models.card import Estimate, Identified
from sainet.report import WRITERS
from sainet.report.pages import render
from sainet.report.palette import styles_of
from sainet.report.table import DASH, EMPTY, Cell, Column, Line, Table
from sainet.runs.documents import write_bytes

_ANY_WIDTH = 10_000  # characters
_LEAST_NAME = 12  # characters of a line of a name that is broken
ESTIMATE_HEADINGS = ("parameter", "before", "value", "95 % interval")


def print_table(table: Table, console: Console) -> None:
    """Print a table.

    A terminal too narrow for a column per disk gets ``disk 1 / disk 2``, as in the
    paper, without the intervals.
    """
    if table.is_empty:
        console.print(EMPTY)
        return
    unbounded = console.options.update(width=_ANY_WIDTH)
    for block in _blocks(table):
        wide = _drawn(block, is_compact=False)
        fits = console.measure(wide, options=unbounded).maximum <= console.width
        console.print(wide if fits else _drawn(block, is_compact=True))
    for sentence in (*table.notes, *table.sentences, *table.verdicts):
        console.print(Text(sentence))


def _blocks(table: Table) -> list[Table]:
    """Return parts of a table that a terminal has room for: three columns each."""
    keys = [column.key for column in table.columns]
    if not any(column.bodies for column in table.columns):
        return [table.part(keys[i : i + 3]) for i in range(0, len(keys), 3)]
    ends = [key for key in keys if key not in ("trans_percent", "pos_mm", "rot_deg")]
    steps = [key for key in keys if key not in ends]
    return [table.part(part) for part in (steps, ends) if part]


def _drawn(table: Table, *, is_compact: bool) -> RichTable:
    drawn = RichTable(box=box.SIMPLE_HEAD, pad_edge=False)
    for heading in _leading(table):
        # A long condition or model is broken.
        side, wraps = ("right", False) if heading == "n" else ("left", is_compact)
        named, least = heading.lower(), _LEAST_NAME if wraps else None
        drawn.add_column(named, justify=side, no_wrap=not wraps, min_width=least)
    for column in table.columns:
        for heading in _rich_headings(column, is_compact=is_compact):
            drawn.add_column(Text(heading), justify="right", no_wrap=True)
    cells_of = table.present_of if is_compact else table.cells_of
    for lines, style in ((table.lines, ""), (table.published, "italic")):
        for line in lines:
            names = map(Text, _names(table, line))  # a name may look like markup
            cells = [
                cell
                for column in table.columns
                for cell in _rich_cells(cells_of(line, column), is_compact)
            ]
            drawn.add_row(*names, *cells, style=style)
        drawn.add_section()
    return drawn


def _rich_headings(column: Column, *, is_compact: bool) -> list[str]:
    if not column.bodies:
        return [column.title]
    disks = [f"disk {body}" for body in column.bodies]
    if is_compact:
        disks = ["disk " + "/".join(map(str, column.bodies))]
    unit = f"\n({column.unit})" if column.unit else ""
    return [f"{column.heading}{unit}\n{disk}" for disk in disks]


def _rich_cells(cells: Sequence[Cell], is_compact: bool) -> list[Text]:  # noqa: FBT001
    texts = [Text(cell.text, style="bold" if cell.is_best else "") for cell in cells]
    if is_compact:
        return [Text("/").join(texts)]
    for cell, text in zip(cells, texts, strict=True):
        if cell.interval:
            text.append(f"\n{cell.interval}", style="dim not bold")
    return texts


def _leading(table: Table) -> list[str]:
    """Return the headings before the first number."""
    first = [table.samples] if table.has_conditions else []
    return [*first, "Model", *(["n"] if table.has_counts else [])]


def _names(table: Table, line: Line) -> list[str]:
    first = [line.condition] if table.has_conditions else []
    count = ["" if line.count is None else str(line.count)] if table.has_counts else []
    return [*first, line.label, *count]


def print_estimates(found: Identified, console: Console) -> None:
    """Print each estimate, parameters that are not identifiable, and the errors.

    Args:
        found: the estimates, before and after.
        console: to print on.
    """
    table = RichTable(box=box.SIMPLE_HEAD, pad_edge=False)
    for index, heading in enumerate(ESTIMATE_HEADINGS):
        table.add_column(heading, justify="right" if index else "left")
    for estimate in found.estimates:
        table.add_row(*map(Text, estimate_cells(estimate)))
    console.print(table)
    for sentence in estimate_sentences(found):
        console.print(Text(sentence))


def estimate_cells(found: Estimate) -> tuple[str, str, str, str]:
    """Return the cells of an estimate, one for each of the headings."""
    name, before = found.name.replace("_", " "), f"{found.start:.3g}"
    if found.doubt:
        return name, before, "kept", DASH
    return name, before, f"{found.value:.3g}", f"{found.low:.3g} to {found.high:.3g}"


def estimate_sentences(found: Identified) -> Iterator[str]:
    """Yield why parameters are not identifiable, then the errors before and after."""
    for estimate in found.estimates:
        if estimate.doubt:
            name = estimate.name.replace("_", " ")
            yield f"{name} is not identifiable: {estimate.doubt}."
    yield (
        f"Mean errors where {found.pushes} pushes were observed: position "
        f"{found.before_mm:.2f} mm before, {found.after_mm:.2f} mm after; "
        f"rotation {found.before_deg:.2f} and {found.after_deg:.2f} degrees."
    )


def write_table(table: Table, path: Path) -> None:
    """Write a table in the format of the file's ending, one of `WRITERS`."""
    place = WRITERS.index(path.suffix)
    write = (to_markdown, to_html, to_latex, to_csv)[place]
    write_bytes(path, write(table).encode())


def to_html(table: Table) -> str:
    """Return the table as an HTML fragment in which every string is escaped."""
    styles = styles_of(line.model for line in table.lines)
    return render("table.html.j2", table=table, styles=styles, empty=EMPTY)


def to_markdown(table: Table) -> str:
    """Return the table as GitHub's Markdown, ``disk 1 / disk 2`` as in the paper."""
    if table.is_empty:
        return f"{EMPTY}\n"
    leading = _leading(table)
    headings = [*leading, *(column.title for column in table.columns)]
    rule = ["--:" if heading == "n" else ":--" for heading in leading]
    rows = [headings, rule + ["--:"] * len(table.columns)]
    for lines, mark in ((table.lines, ""), (table.published, "*")):
        for line in lines:
            names = [_marked(_plain(name), mark) for name in _names(table, line)]
            rows.append(
                names
                + [_markdown(table.present_of(line, c), mark) for c in table.columns]
            )
    text = "\n".join("| " + " | ".join(row) + " |" for row in rows)
    below = [f"- {_plain(each)}" for each in (*table.notes, *table.sentences)]
    parts = [text, _note(table), "\n".join(below)]
    parts += [f"**{_plain(verdict)}**" for verdict in table.verdicts]
    return "\n\n".join(part for part in parts if part) + "\n"


def _note(table: Table) -> str:
    bodies = next((column.bodies for column in table.columns if column.bodies), ())
    disks = " / ".join(f"disk {body}" for body in bodies)
    return f"Numbers: {disks}. {table.note}" if disks else table.note


def _markdown(cells: Sequence[Cell], mark: str) -> str:
    values = " / ".join(_marked(c.text, "**" if c.is_best else mark) for c in cells)
    intervals = [cell.interval for cell in cells]
    small = f"<br><sub>{' / '.join(intervals)}</sub>" if any(intervals) else ""
    return values + small


def _marked(text: str, mark: str) -> str:
    return f"{mark}{text}{mark}" if text else ""


def _plain(text: str) -> str:
    """Return text in which nothing means anything to Markdown, HTML or a table."""
    single = " ".join(text.split())
    return re.sub(r"([\\`*_\[\]|~])", r"\\\1", html.escape(single, quote=False))


def to_latex(table: Table) -> str:
    """Return the table as a LaTeX tabular: values, the best of a column in bold."""
    columns = [(c, body) for c in table.columns for body in c.bodies or (0,)]
    headings = [*_leading(table), *(_heading(*each) for each in columns)]
    sides = "l" * len(_leading(table)) + "r" * len(columns)
    lines = [
        rf"\begin{{tabular}}{{{sides}}}",
        r"\hline",
        " & ".join(map(_tex, headings)) + r" \\",
        r"\hline",
    ]
    for line in (*table.lines, *table.published):
        texts = [
            rf"\textbf{{{_tex(cell.text)}}}" if cell.is_best else _tex(cell.text)
            for cell in line.cells
        ]
        names = [_tex(name) for name in _names(table, line)]
        lines.append(" & ".join([*names, *texts]) + r" \\")
    return "\n".join([*lines, r"\hline", r"\end{tabular}"]) + "\n"


# The bracket would be read as an argument of the end of the row before.
_TEX = {each: f"\\{each}" for each in "&%$#_{}"} | {
    "\\": r"\textbackslash{}",
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
    "<": r"\textless{}",
    ">": r"\textgreater{}",
    "|": r"\textbar{}",
    "[": "{[}",
    "–": "--",  # noqa: RUF001
}


def _tex(text: str) -> str:
    """Return text in which nothing means anything to LaTeX."""
    return "".join(_TEX.get(character, character) for character in text)


def to_csv(table: Table) -> str:
    """Return the table as CSV: values and intervals in columns, empty if unknown."""
    columns = [(c, body) for c in table.columns for body in c.bodies or (0,)]
    headings = [
        f"{_heading(*each)}{part}" for each in columns for part in ("", " interval")
    ]
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow([*_leading(table), *headings])
    for line in (*table.lines, *table.published):
        pairs = ((cell.text.strip(DASH), cell.interval) for cell in line.cells)
        writer.writerow([*_names(table, line), *chain(*pairs)])
    return stream.getvalue()


def _heading(column: Column, body: int) -> str:
    return f"{column.title} disk {body}" if body else column.title
