"""Write the first figures of README.md, read off docs/results.md.

    python tools/headlines.py

`tools/results.py` does it after each section. The page is where a figure stands with
its command, machine and interval; the README repeats a few of them.
"""

import re
from collections.abc import Sequence
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
    return "".join([before, begin, *lines, end, after])


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


def _of_prediction(rows: Sequence[Row]) -> str:
    def errors(model: str) -> str:
        row = _one(rows, Model=model)
        return f"{row['pos (mm)']} mm and {row['rot (deg)']} degrees"

    return (
        "**Prediction**, Bullet with noise as the truth (the paper's Table III; error "
        "over a push of the first / the second disk): an engine with assumed masses "
        f"and radii {errors('Physics')}; with true ones "
        f"{errors('Physics, calibrated')}; a network alone, trained on 4,500 pushes, "
        f"{errors('IN')}; SAIN, the network around the first engine, {errors('SAIN')}."
    )


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
    "Table III: robot, two disks": _of_prediction,
    "Control in simulation": _of_control,
    "Benchmarks": _of_search,
    "Calibrate or learn, on recorded pushes (real)": _of_recorded,
}

if __name__ == "__main__":
    main()
