"""Pages of results: every table, figure and number rendered from `results/`.

    python -m sainet.report.pages.results [FOLDER ...]

First the measurements of each FOLDER, of a study that `sainet reproduce` ran, are put
into ``results/``. Prose stands in the templates in ``docs/templates``, which set their
titles; numbers come from measurements.
"""

import sys
from collections.abc import Sequence
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple, cast

import jinja2
import msgspec

from sainet.evaluation.claims import places
from sainet.evaluation.measurements import read_measurements
from sainet.evaluation.summary import BASELINE, Summary, summarise
from sainet.report.arrange import arrange
from sainet.report.palette import labels_of
from sainet.report.verdicts import beside_published, worded_places
from sainet.report.writers import to_markdown
from sainet.runs.documents import read_document, read_json, write_bytes
from sainet.runs.folders import CONFIG

MEASUREMENTS, AS_TRAINED = "measurements.nc", "as-trained.nc"  # of a study
TEMPLATES, PAGES, RESULTS = "docs/templates", "docs/results", "results"
BEGIN, END = "<!-- rendered by make pages -->\n", "<!-- end of rendered text -->"
_INDEX, _README = "index.md", "readme-block.md"
_ERRORS = ("pos_mm", "rot_deg")


class PlainTable(msgspec.Struct, frozen=True):
    """Cells as text."""

    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


class PlainTables(msgspec.Struct, frozen=True):
    """Tables of single figures, such as timings, and where they were taken."""

    note: str
    machine: str
    tables: tuple[PlainTable, ...]
    titles: tuple[str, ...] = ()


class Page(NamedTuple):
    """A rendered page; its template sets its title."""

    title: str
    text: str


class Evidence:
    """The summaries of all studies, read from the folder ``results``."""

    def __init__(self, root: Path) -> None:
        """Look for evidence in the folder ``results`` of a repository."""
        self.folder = root / RESULTS
        self._summaries: dict[tuple[str, str], Summary] = {}

    def summary(self, name: str, subject: str = "") -> Summary:
        """Return the summary of a study, from its measurements if they were kept."""
        if (name, subject) not in self._summaries:
            measured = self.folder / f"{name}.nc.xz"
            self._summaries[name, subject] = (
                summarise(read_measurements(measured), subject=subject)
                if measured.is_file()
                else read_document(self.folder / f"{name}.json", Summary)
            )
        return self._summaries[name, subject]

    def figures(self, name: str) -> PlainTables:
        """Return tables of single figures."""
        return read_document(self.folder / f"{name}.tables.json", PlainTables)

    @cached_property
    def helpers(self) -> dict[str, object]:
        """The functions that templates call."""
        return {
            "table": lambda name: to_markdown(arrange(self.summary(name))),
            "origin": lambda name: origin(self.summary(name)),
            "ratios": lambda name: ratios(self.summary(name)),
            "beside_paper": lambda name: beside_published(self.summary(name)),
            "readings": lambda name: readings(self.summary(name)),
            "plain": lambda name: plain(self.figures(name)),
            "errors": self._errors,
            "solved": self._solved,
            "figure": self._figure,
            "trainings": self._trainings,
        }

    def _trainings(self, name: str) -> str:
        """Return training runs of each network, and test pushes, in words."""
        rows = self.summary(name).rows
        runs = sorted({row.trainings for row in rows if row.trainings > 1})
        pushes = sorted({row.count for row in rows if row.count})
        counts = " or ".join(map(str, runs)) or "one"
        return f"{counts} training runs of each network; {pushes[-1]} test pushes"

    def _errors(
        self, name: str, model: str, metrics: Sequence[str] = _ERRORS, where: str = ""
    ) -> list[str]:
        """Return the errors of a model, disks apart: one text for each metric."""
        summary = self.summary(name)
        return [slashed(summary.errors(model, key, where)) for key in metrics]

    def _solved(self, condition: str, model: str) -> str:
        rows = self.summary("simulated-control").trials
        (row,) = (r for r in rows if (r.condition, r.model) == (condition, model))
        return f"{row.solved} of {row.trials}"

    def _figure(self, name: str, table: int, figure: str) -> float:
        rows = self.figures(name).tables[table].rows
        return float({row[0]: row[1] for row in rows}[f"`{figure}`"])


def slashed(values: Sequence[float]) -> str:
    """Return values disk by disk: ``0.64 / 0.54``."""
    return " / ".join(f"{value:.2f}" for value in values)


def origin(summary: Summary) -> str:
    """Return the command, the note and the machine of a summary, in a paragraph."""
    source = summary.provenance
    words = " ".join(source.command)
    parts = [f"`{words}`." if words else "", source.note]
    if machine := source.manifest:
        known = ", ".join(f"{k} {v}" for k, v in machine.versions.items() if v)
        parts.append(f"Machine: {machine.processor}, {machine.cores} cores; {known}.")
    return " ".join(part for part in parts if part)


def ratios(summary: Summary) -> str:
    """Return tables of errors over those of physics, disk by disk."""
    labels = labels_of(summary.models)
    slugs = dict.fromkeys(row.model for row in summary.rows if row.model != BASELINE)
    head = " | ".join(labels[slug] for slug in slugs)
    parts = []
    for key, name in zip(_ERRORS, ("Position", "Rotation"), strict=True):
        lines = [f"| {name} error over that of Physics | {head} |"]
        lines.append("| :-- |" + " --: |" * len(slugs))
        for condition in summary.conditions:
            below = summary.errors(BASELINE, key, condition.label)
            cells = [
                slashed([a / b for a, b in zip(above, below, strict=True)])
                if (above := summary.errors(slug, key, condition.label))
                else "–"  # noqa: RUF001
                for slug in slugs
            ]
            lines.append(f"| {condition.label or 'all'} | {' | '.join(cells)} |")
        parts.append("\n".join(lines))
    return "\n\n".join(parts)


def readings(summary: Summary) -> str:
    """Return where every SAIN is better or worse than true-property physics and IN."""
    sains = [m.slug for m in summary.models if m.kind == "sain"]
    lines = []
    for condition in summary.conditions:
        where = f"*{condition.label}*: " if condition.label else ""
        for model in sains:
            for against in ("physics-true", "in"):
                found = places(
                    summary,
                    model,
                    against,
                    metrics=_ERRORS,
                    condition=condition.label,
                )
                lines.append(f"- {where}{worded_places(found, summary)}")
    return "\n".join(lines)


def plain(found: PlainTables) -> str:
    """Return tables of single figures as Markdown."""
    parts = [f"{found.note} Machine: {found.machine}"]
    for number, table in enumerate(found.tables):
        if number < len(found.titles):
            parts.append(f"`{found.titles[number]}`")
        lines = [table.columns, (":--", *["--:"] * (len(table.columns) - 1))]
        rows = [f"| {' | '.join(line)} |" for line in (*lines, *table.rows)]
        parts.append("\n".join(rows))
    return "\n\n".join(parts)


def rendered(root: Path) -> dict[Path, str]:
    """Return the text of every page, by its path; README.md with its block.

    Args:
        root: the repository.
    """
    templates = root / TEMPLATES
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(templates),
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        autoescape=False,  # noqa: S701  (Markdown from our own templates)
    )
    environment.globals.update(cast(Any, Evidence(root).helpers))
    pages = {
        path.stem: _page(environment.get_template(path.name))
        for path in sorted(templates.glob("*.md.j2"))
        if path.stem != _INDEX
    }
    block = pages.pop(_README)
    titles = {name: page.title for name, page in pages.items()}
    pages[_INDEX] = _page(environment.get_template(f"{_INDEX}.j2"), titles=titles)
    readme = root / "README.md"
    return {root / PAGES / name: page.text for name, page in pages.items()} | {
        readme: with_block(readme.read_text("utf-8"), block.text)
    }


def _page(template: jinja2.Template, **values: object) -> Page:
    module = template.make_module(values)
    return Page(vars(module).get("title", ""), str(module).strip() + "\n")


def with_block(text: str, block: str) -> str:
    """Return a text with its rendered block replaced.

    Raises:
        ValueError: the text has no place for it.
    """
    before, begin, rest = text.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not (begin and end):
        raise ValueError(f"no {BEGIN.strip()} before {END}")
    return before + begin + block + end + after


def draw_figures(root: Path) -> None:
    """Draw the figures of data efficiency from their measurements."""
    from sainet.report.figures.efficiency import draw_data_efficiency

    for name in ("data-efficiency", "recorded-data-efficiency"):
        path = root / "docs" / "figures" / f"{name}.svg"
        draw_data_efficiency(Evidence(root).summary(name), path)


def keep(folder: Path, root: Path) -> None:
    """Keep the measurements of a study in ``results/``, at published precision.

    Args:
        folder: of the study, as `sainet reproduce` wrote it.
        root: the repository.

    Raises:
        BadInput: the folder holds no measurements.
    """
    study = read_json(folder / CONFIG).get("study", folder.name)
    for file, name in ((MEASUREMENTS, f"{study}"), (AS_TRAINED, f"{study}-as-trained")):
        if file == MEASUREMENTS or (folder / file).is_file():
            measured = read_measurements(folder / file)
            measured.compact().write(root / RESULTS / f"{name}.nc.xz")


def main() -> None:
    """Keep the measurements of the given folders, then write every page."""
    root = Path.cwd()
    for folder in sys.argv[1:]:
        keep(Path(folder), root)
    for path, text in rendered(root).items():
        write_bytes(path, text.encode())
    draw_figures(root)


if __name__ == "__main__":
    main()
