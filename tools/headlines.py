"""Write the first figures of README.md, read off docs/results.md.

    python tools/headlines.py

`tools/results.py` does it after each section. The page is where a figure stands with
its command, machine and interval; the README repeats a few of them.
"""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PAGE, README = ROOT / "docs" / "results.md", ROOT / "README.md"
BEGIN, END = "<!-- figures: tools/headlines.py -->\n", "<!-- end of figures -->"

Row = dict[str, str]  # the text of a cell by its heading


def main() -> None:
    """Write the figures into the README."""
    README.write_text(updated(README.read_text("utf-8"), PAGE.read_text("utf-8")))


def updated(readme: str, page: str) -> str:
    """Return the README with the figures of a page of results.

    Raises:
        ValueError: the README has no place for them, or the page has no such figure.
    """
    before, begin, rest = readme.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not (begin and end):
        raise ValueError(f"README.md has no {BEGIN.strip()} before {END}")
    lines = [f"- {tell(_rows(page, title))}\n" for title, tell in _TOLD.items()]
    tables = {title: _rows(page, title) for title in _TABLES}
    table = _of_prediction({title: rows for title, rows in tables.items() if rows})
    return "".join([before, begin, table, "\n", *lines, end, after])


def _rows(page: str, title: str) -> list[Row]:
    """Return the rows of every table of a section, without intervals and marks."""
    section = page.partition(f"\n## {title}\n")[2].partition("\n## ")[0]
    rows, headings = [], list[str]()
    for line in section.splitlines():
        cells = [_plain(cell) for cell in re.split(r"(?<!\\)\|", line)[1:-1]]
        if headings and cells and not set(line) <= set("|:- "):
            rows.append(dict(zip(headings, cells, strict=True)))
        headings = (headings or cells) if cells else []
    return rows


def _plain(cell: str) -> str:
    return re.sub(r"<br>.*| \(mean of \d+\)|[*`]", "", cell).strip()


def _one(rows: Sequence[Row], **cells: str) -> Row:
    """Return the row that has these cells."""
    found = [row for row in rows if row.items() >= cells.items()]
    if len(found) != 1:
        raise ValueError(f"{len(found)} rows have {cells}; one is wanted")
    return found[0]


def _of_prediction(tables: Mapping[str, Sequence[Row]]) -> str:
    """Return a table: a line for each model, a column for each of the paper's tables.

    Raises:
        ValueError: a table lacks a model.
    """
    heads = [f"{title.partition(':')[0]}: {_TABLES[title]}" for title in tables]
    lines = [
        [told, *(_errors(rows, model) for rows in tables.values())]
        for model, told in _PREDICTED.items()
    ]
    rule = [":--", *(["--:"] * len(tables))]
    text = "\n".join(f"| {' | '.join(line)} |" for line in [["", *heads], rule, *lines])
    return (
        "The paper's tables of **prediction** errors: mean over a push of disk 1 / 2 "
        "(/ 3); the truth is Bullet with noise, networks are trained on 4,500 pushes "
        f"of two disks, five times each:\n\n{text}\n"
    )


def _errors(rows: Sequence[Row], model: str) -> str:
    """Return the errors of a model, after it has met a bystander if it ever does."""
    beside = f"{model}, bystander"
    if any(row.get("Model") == beside for row in rows):
        model = beside
    row = _one(rows, Model=model)
    return f"{row['pos (mm)']} mm<br>{row['rot (deg)']}°"


_TABLES = {
    "Table I: direct force, two disks": "a force, two disks",
    "Table II: direct force, three disks": "three disks (networks after bystanders)",
    "Table III: robot, two disks": "the robot, two disks",
}
_PREDICTED = {
    "Physics": "`physics`: Bullet, assumed masses and radii",
    "Physics, true properties": "`physics-true`: Bullet, true ones",
    "IN": "`in`: a network alone",
    "SAIN around Bullet": "`sain-bullet`: a network around `physics`, the paper's SAIN",
    "SAIN": "`sain`: around the planar engine, assumed ones",
    "SAIN, true properties": "`sain-true`: around the planar engine, true ones",
}


def _of_control(rows: Sequence[Row]) -> str:
    solved = {
        goals: [
            _one(rows, trials=f"{goals}, {planner}", model="SAIN")["solved"]
            for planner in ("greedy", "tree")
        ]
        for goals in ("easy", "hard")
    }
    told = ", ".join(
        f"{greedy} and {tree} of the {goals} goals"
        for goals, (greedy, tree) in solved.items()
    )
    return (
        "**Control**, Bullet with noise as the world: with the paper's search and with "
        f"ours SAIN solves {told}."
    )


def _of_search(rows: Sequence[Row]) -> str:
    def value(figure: str) -> float:
        # Planning is the last benchmark; those before share names of figures with it.
        return float([r["value"] for r in rows if r["figure"] == figure][-1])

    return (
        f"**Search**: every sequence of two pushes, {value('looked_at'):,.0f} in all, "
        f"in {value('full_tree_s'):.2f} s on {value('devices'):.0f} cores, "
        f"{value('bullet_ratio'):.0f} times faster than through Bullet one by one."
    )


def _of_recorded(rows: Sequence[Row]) -> str:
    def errors(model: str) -> str:
        row = _one(rows, Pushes="all", Model=model)
        return f"{row['final pos (mm)']} mm and {row['final rot (deg)']} degrees"

    return (
        "**Real pushes**, cross-validated, where the disk ends: the engine as it is "
        f"{errors('Physics')}; identified {errors('physics-identified')}; SAIN around "
        f"the identified engine {errors('sain-identified-residual')}, and when it sees "
        f"where on the table it is {errors('sain-identified-residual-place')}; a "
        f"published model of these pushes {errors('zhou-poly4, published')}."
    )


_TOLD = {
    "Control in simulation": _of_control,
    "Benchmarks": _of_search,
    "Calibrate or learn, on recorded pushes (real)": _of_recorded,
}

if __name__ == "__main__":
    main()
