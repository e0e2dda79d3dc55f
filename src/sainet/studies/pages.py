"""Pages of results: every table, figure and number rendered from `results/`.

    python -m sainet.studies.pages [PATH ...]

First the evidence in each PATH is put into ``results/``: the folder of a study that
`sainet reproduce` ran or of `sainet identify`, a file with the JSON of `sainet bench`,
or the record of an episode that is drawn. Prose stands in the templates in
``docs/templates``, which set their titles; numbers come from measurements.
"""

import re
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple, cast

import jinja2

from sainet.evaluation.coverage import HEADINGS, rows_of
from sainet.evaluation.measurements import Measurements
from sainet.evaluation.rulings import rule_on
from sainet.evaluation.summary import Summary
from sainet.report.verdicts import beside_published, rulings
from sainet.runs.documents import write_bytes
from sainet.studies import STUDIES, load_study
from sainet.studies.active_choice import saving
from sainet.studies.conclusions import HEADINGS as CLAIM_HEADINGS
from sainet.studies.conclusions import conclude
from sainet.studies.conclusions import rows_of as rows_of_claims
from sainet.studies.evidence import FIGURES, Evidence, described, keep
from sainet.studies.page_parts import (
    ERRORS,
    TRANSCRIBED,
    bench,
    choices,
    draw_figures,
    figure_of,
    identified,
    main_table,
    ratios,
    slashed,
    table,
)

TEMPLATES, PAGES = "docs/templates", "docs/results"
BEGIN, END = "<!-- rendered by make pages -->\n", "<!-- end of rendered text -->"
_INDEX, _README = "index.md", "readme-block.md"
_LAST = ("findings.md", _INDEX)  # name other pages, by their titles


class Page(NamedTuple):
    """A rendered page; its template sets its title."""

    title: str
    text: str


def helpers(evidence: Evidence) -> dict[str, object]:
    """Return the functions that templates call."""
    summary = evidence.summary
    chosen = lambda name: load_study(name).choose(summary(name))  # noqa: E731
    return {
        "summary": summary,
        "coverage": lambda name, *labels: table(
            HEADINGS, rows_of(evidence.measured(name), labels), align=":--"
        ),
        "question": lambda name: f"**{load_study(name).question}**",
        "table": lambda name, *labels: "\n\n".join(
            filter(
                None, [figure_of(name, evidence), main_table(summary(name), *labels)]
            )
        ),
        "plot": lambda name: figure_of(name, evidence),
        "origin": lambda name: origin(name, evidence),
        "claims": lambda name: "\n\n".join(
            rulings(load_study(name).claims, summary(name))
        ),
        "verdict": lambda name, text: verdict(name, text, summary(name)),
        "paper_verdict": lambda text: paper_verdict(text, evidence),
        "conclusions": lambda *of: conclusions(evidence, *of),
        "choose": chosen,
        "choices": lambda name, *most: choices(chosen(name), *most),
        "ratios": lambda name: ratios(summary(name)),
        "beside_paper": lambda name: beside_published(summary(name)),
        "trainings": lambda name: trainings(summary(name)),
        "errors": lambda name, *which: errors(summary(name), *which),
        "saving": lambda name, metric: saving(evidence.measured(name), metric),
        "solved": solved,
        "travel": lambda name, *where: travel(evidence.measured(name), *where),
        "identified": lambda: identified(evidence.identifications()),
        "bench": lambda case, names: bench(evidence.benchmark(case), names),
        "figure": lambda case, name: evidence.benchmark(case).figures[name],
    }


def trainings(summary: Summary) -> str:
    """Return training runs of each network, and test pushes, in words."""
    runs = sorted({row.trainings for row in summary.rows if row.trainings > 1})
    most = max(row.count for row in summary.rows if row.count)
    count, s = " or ".join(map(str, runs)) or "one", "s" * bool(runs)
    return f"{count} training run{s} of each network; {most} test pushes"


def errors(
    summary: Summary, model: str, metrics: Sequence[str] = ERRORS, where: str = ""
) -> list[str]:
    """Return the errors of a model, disks apart: one text for each metric."""
    return [slashed(summary.errors(model, key, where)) for key in metrics]


def travel(measured: Measurements, where: str = "") -> str:
    """Return how far each disk moved in a condition, on average, in mm."""
    (condition,) = (c for c in measured.header.conditions if c.label == where)
    moved = measured.data["travel_mm"].values[measured.samples_of(condition)]
    return " / ".join(f"{mean:.0f}" for mean in moved.mean(axis=0))


def solved(summary: Summary, condition: str, model: str) -> str:
    """Return how many of the goals of a condition a model solved."""
    rows = summary.trials
    (row,) = (r for r in rows if (r.condition, r.model) == (condition, model))
    return f"{row.solved} of {row.trials}"


def origin(name: str, evidence: Evidence) -> str:
    """Return the files of the complete tables, the command and the machine.

    The site links the names of files, which are made when it is built.

    Args:
        name: of a study, or of other measurements.
        evidence: of the studies.
    """
    summary = evidence.summary(name)
    source, pairs = summary.provenance, len(summary.comparisons) + len(summary.tests)
    compared = f" and all {pairs:,} comparisons" if pairs else ""
    files = f"`tables/{name}.html`, to sort, and `tables/{name}.csv`"
    words = " ".join(source.command)
    parts = [
        f"Every number{compared}: {files}, made by `make docs`.",
        f"Command: `{words}`." if words else "",
        source.note,
        f"Machine: {described(source.manifest)}." if source.manifest else "",
    ]
    return " ".join(filter(None, parts))


def verdict(name: str, text: str, summary: Summary) -> str:
    """Return the ruling on the claim of a study that has this text.

    Args:
        name: of the study.
        text: of the claim.
        summary: of the measurements of the study.
    """
    ruled = rule_on(load_study(name).claims, summary)
    (found,) = (each for each in ruled if each.claim.text == text)
    p = f" (p\N{NO-BREAK SPACE}{found.p:.2g})" if found.p else ""
    return f"**{found.status}**{p}"


def paper_verdict(text: str, evidence: Evidence) -> str:
    """Return the ruling on the claim of the paper that has this text."""
    found = conclude(evidence.find)
    return next(f"**{each.assumed}**" for each in found if each.claim.text == text)


def conclusions(evidence: Evidence, study: str | None = None) -> str:
    """Return the claims of the paper, all or those that a study tests, as a table."""
    found = conclude(evidence.find)
    shown = [each for each in found if study in (None, each.claim.study)]
    return table(CLAIM_HEADINGS, rows_of_claims(shown), align=":--")


def findings(evidence: Evidence, pages: Mapping[str, str]) -> str:
    """Return every claim with its verdict and the page of its study, as a table.

    Args:
        evidence: of the studies.
        pages: links to the pages of studies.
    """
    rows: list[tuple[str, ...]] = []
    for name in filter(pages.__contains__, STUDIES):
        claims = load_study(name).claims
        summary = evidence.summary(name) if claims else Summary(models=())
        for each in rule_on(claims, summary):
            p = "" if each.p is None else f"{each.p:.2g}"
            rows.append((each.claim.text, f"**{each.status}**", p, pages[name]))
    return table(("claim", "verdict", "p", "page"), rows, align=":--")


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
    evidence = Evidence(root)
    environment.globals.update(cast(Any, helpers(evidence)))
    names = [p.stem for p in templates.glob("*.md.j2") if p.stem not in _LAST]
    pages = {n: _page(environment.get_template(f"{n}.j2")) for n in sorted(names)}
    block = pages.pop(_README)
    for name in _LAST:
        titles = {name: page.title for name, page in pages.items()}
        links = {
            study: f"[{title}]({page})"
            for page, title in titles.items()
            for study in (Path(page).stem, *_shown(templates / f"{page}.j2"))
        }
        found = findings(evidence, links)
        transcribed = [k for k, page in pages.items() if TRANSCRIBED in page.text]
        template = environment.get_template(f"{name}.j2")
        pages[name] = _page(
            template, titles=titles, findings=found, transcribed=transcribed
        )
    readme = root / "README.md"
    return {root / PAGES / name: page.text for name, page in pages.items()} | {
        readme: with_block(readme.read_text("utf-8"), block.text)
    }


def _shown(template: Path) -> list[str]:
    """Return the studies whose claims a page shows."""
    return re.findall(r'\bclaims\("([^"]+)"\)', template.read_text("utf-8"))


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


def main() -> None:
    """Keep the evidence in the given paths, then write every page."""
    root = Path.cwd()
    for path in sys.argv[1:]:
        keep(Path(path), root)
    for path, text in rendered(root).items():
        write_bytes(path, text.encode())
    draw_figures(Evidence(root), root / FIGURES)


if __name__ == "__main__":
    main()
