"""The table of control trials, for a terminal, for Markdown and for a page."""

from collections.abc import Mapping
from typing import Any

from rich import box
from rich.console import Console
from rich.table import Table
from rich.text import Text

from sainet.report.pages.templates import render
from sainet.report.palette import styles_of
from sainet.report.rows import DASH

HEADINGS = (
    *("trials", "model", "solved", "success (95 %)", "pushes (median)"),
    *("within 25 pushes", "within 4 mm", "decision (s)"),
)
_TEXT_COLUMNS = 2
CHANCE = 0.05  # a p below it is told


def is_control(result: Mapping[str, Any]) -> bool:
    """Return whether a result is of control trials, not of prediction errors."""
    rows = result.get("rows") or [{}]
    return "success" in rows[0]


def print_control(result: Mapping[str, Any], console: Console) -> None:
    """Print the table of control trials and what the paired tests found."""
    drawn = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    for index, heading in enumerate(HEADINGS):
        side = "left" if index < _TEXT_COLUMNS else "right"
        drawn.add_column(heading, justify=side)
    for cells in _ours(result):
        drawn.add_row(*map(Text, cells))
    drawn.add_section()
    for cells in _theirs(result):
        drawn.add_row(*map(Text, cells), style="italic")
    console.print(drawn)
    for sentence in sentences(result):
        console.print(Text(sentence))


def control_markdown(result: Mapping[str, Any]) -> str:
    """Return the table of control trials as GitHub's Markdown."""
    rule = [":--"] * _TEXT_COLUMNS + ["--:"] * (len(HEADINGS) - _TEXT_COLUMNS)
    slanted = [[f"*{cell}*" for cell in cells] for cells in _theirs(result)]
    rows = [list(HEADINGS), rule, *_ours(result), *slanted]
    lines = ["| " + " | ".join(row) + " |" for row in rows]
    return "\n".join([*lines, "", *(f"- {s}" for s in sentences(result)), ""])


def control_html(result: Mapping[str, Any]) -> str:
    """Return the table of control trials as HTML in which every string is escaped."""
    styles = styles_of(str(row["model"]) for row in result["rows"])
    return render(
        "control.html.j2",
        headings=HEADINGS,
        ours=_ours(result),
        variables=[styles[str(row["model"])].variable for row in result["rows"]],
        theirs=_theirs(result),
        sentences=sentences(result),
    )


def sentences(result: Mapping[str, Any]) -> list[str]:
    """Say what sight missed, and which goals one model reached and another did not."""
    labels = _labels(result)
    early = [
        f"{row['group']}, {labels[row['model']]}: {row['ended_early']} of "
        f"{row['trials'] - row['solved']} not solved ended as the disk was seen there"
        for row in result["rows"]
        if row["ended_early"]
    ]
    pairs = filter(_is_told, result.get("pairs") or ())
    return early + [
        f"{pair['group']}, {pair['measure'].replace('_', ' ')}: "
        f"{labels[pair['model']]} alone {pair['only_one']}, "
        f"{labels[pair['against']]} alone {pair['only_other']} "
        f"(exact McNemar p = {pair['p']:.2g})"
        for pair in pairs
    ]


def _is_told(pair: Mapping[str, Any]) -> bool:
    """Tell every difference in success, and of the other measures what is no chance."""
    if pair["measure"] == "solved":
        return bool(pair["only_one"] or pair["only_other"])
    return pair["p"] < CHANCE


def _labels(result: Mapping[str, Any]) -> dict[str, str]:
    styles = styles_of(str(row["model"]) for row in result["rows"])
    return {name: style.label for name, style in styles.items()}


def _ours(result: Mapping[str, Any]) -> list[list[str]]:
    labels = _labels(result)
    return [
        [
            str(row["group"]),
            labels[str(row["model"])],
            f"{row['solved']}/{row['trials']}",
            "{:.0%}{}{:.0%}".format(row["interval"][0], DASH, row["interval"][1]),
            _number(row["median_pushes"], "{:g}"),
            f"{row['within_25_pushes']:.0%}",
            f"{row['within_4_mm']:.0%}",
            _number(row["median_decision_s"], "{:.3f}"),
        ]
        for row in result["rows"]
    ]


def _theirs(result: Mapping[str, Any]) -> list[list[str]]:
    labels = _labels(result)
    return [
        [
            str(row["group"]),
            f"{labels.get(str(row['model']), row['model'])}, published",
            f"{round(row['success'] * row['trials'])}/{row['trials']}",
            *[DASH] * (len(HEADINGS) - 3),
        ]
        for row in result.get("published") or ()
    ]


def _number(value: float | None, form: str) -> str:
    return DASH if value is None else form.format(value)
