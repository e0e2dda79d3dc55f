"""Pages of results: every table, figure and number rendered from `results/`.

    python -m sainet.studies.pages [PATH ...]

First the evidence in each PATH is put into ``results/``: the folder of a study that
`sainet reproduce` ran or of `sainet identify`, a file with the JSON of `sainet bench`,
or the record of an episode that is drawn. Prose stands in the templates in
``docs/templates``, which set their titles; numbers come from measurements.
"""

import sys
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple, cast

import jinja2

from sainet.evaluation.claims import places
from sainet.evaluation.coverage import HEADINGS, rows_of
from sainet.evaluation.measurements import Measurements
from sainet.evaluation.rulings import rule_on
from sainet.evaluation.summary import BASELINE, Summary
from sainet.report.arrange import arrange
from sainet.report.palette import labels_of
from sainet.report.verdicts import beside_published, rulings, worded_places
from sainet.report.writers import (
    ESTIMATE_HEADINGS,
    estimate_cells,
    estimate_sentences,
    to_markdown,
)
from sainet.runs.documents import write_bytes
from sainet.studies import STUDIES, load_study
from sainet.studies.conclusions import HEADINGS as CLAIM_HEADINGS
from sainet.studies.conclusions import conclude
from sainet.studies.conclusions import rows_of as rows_of_claims
from sainet.studies.evidence import (
    FIGURES,
    Benchmark,
    Evidence,
    Identification,
    described,
    keep,
)
from sainet.studies.page_figures import draw_figures
from sainet.studies.recorded_active import saving
from sainet.studies.study import Choice

TEMPLATES, PAGES = "docs/templates", "docs/results"
BEGIN, END = "<!-- rendered by make pages -->\n", "<!-- end of rendered text -->"
_INDEX, _README = "index.md", "readme-block.md"
_ERRORS = ("pos_mm", "rot_deg")


class Page(NamedTuple):
    """A rendered page; its template sets its title."""

    title: str
    text: str


def helpers(evidence: Evidence) -> dict[str, object]:
    """Return the functions that templates call."""
    summary = evidence.summary
    return {
        "summary": summary,
        "coverage": lambda name, *labels: _table(
            HEADINGS, rows_of(evidence.measured(name), labels), align=":--"
        ),
        "table": lambda name: to_markdown(arrange(summary(name))),
        "origin": lambda name: origin(summary(name)),
        "claims": lambda name: "\n\n".join(
            rulings(load_study(name).claims, summary(name))
        ),
        "conclusions": lambda: _table(
            CLAIM_HEADINGS, rows_of_claims(conclude(evidence.find)), align=":--"
        ),
        "choose": lambda name: load_study(name).choose(summary(name)),
        "choices": lambda name: choices(load_study(name).choose(summary(name))),
        "ratios": lambda name: ratios(summary(name)),
        "beside_paper": lambda name: beside_published(summary(name)),
        "readings": lambda name: readings(summary(name)),
        "trainings": lambda name: trainings(summary(name)),
        "errors": lambda name, *which: errors(summary(name), *which),
        "saving": lambda metric: saving(evidence.measured("recorded-active"), metric),
        "solved": solved,
        "travel": lambda name, *where: travel(evidence.measured(name), *where),
        "identified": lambda: identified(evidence.identifications()),
        "bench": lambda case: bench(evidence.benchmark(case)),
        "figure": lambda case, name: evidence.benchmark(case).figures[name],
    }


def trainings(summary: Summary) -> str:
    """Return training runs of each network, and test pushes, in words."""
    runs = sorted({row.trainings for row in summary.rows if row.trainings > 1})
    pushes = sorted({row.count for row in summary.rows if row.count})
    counts = " or ".join(map(str, runs)) or "one"
    return f"{counts} training runs of each network; {pushes[-1]} test pushes"


def errors(
    summary: Summary, model: str, metrics: Sequence[str] = _ERRORS, where: str = ""
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


def choices(tried: Sequence[Choice]) -> str:
    """Return the settings that a study tried, with their scores, as a table."""
    return _table(tried[0].cells, (each.cells.values() for each in tried))


def slashed(values: Sequence[float]) -> str:
    """Return values disk by disk: ``0.64 / 0.54``."""
    return " / ".join(f"{value:.2f}" for value in values)


def origin(summary: Summary) -> str:
    """Return the command, the note and the machine of a summary, in a paragraph."""
    source = summary.provenance
    words = " ".join(source.command)
    parts = [f"`{words}`." if words else "", source.note]
    if source.manifest:
        parts.append(f"Machine: {described(source.manifest)}.")
    return " ".join(part for part in parts if part)


def findings(evidence: Evidence, titles: Mapping[str, str]) -> str:
    """Return every claim with its verdict and the page of its study, as a table.

    Args:
        evidence: of the studies.
        titles: of pages, by the names of their templates.
    """
    rows: list[tuple[str, ...]] = []
    for name in STUDIES:
        claims = load_study(name).claims if name in titles else ()
        summary = evidence.summary(name) if claims else Summary(models=())
        page = f"[{titles[name]}]({name}.md)" if claims else ""
        for each in rule_on(claims, summary):
            p = "" if each.p is None else f"{each.p:.2g}"
            rows.append((each.claim.text, f"**{each.status}**", p, page))
    return _table(("claim", "verdict", "p", "page"), rows, align=":--")


def _table(
    head: Iterable[str], rows: Iterable[Iterable[str]], *, align: str = "--:"
) -> str:
    """Return a table as Markdown, its first column on the left."""
    head = list(head)
    lines = (head, (":--", *[align] * (len(head) - 1)), *rows)
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def ratios(summary: Summary) -> str:
    """Return tables of errors over those of physics, disk by disk."""
    labels = labels_of(summary.models)
    slugs = dict.fromkeys(row.model for row in summary.rows if row.model != BASELINE)
    parts = []
    for key, name in zip(_ERRORS, ("Position", "Rotation"), strict=True):
        head = [f"{name} error over that of Physics", *(labels[slug] for slug in slugs)]
        lines: list[list[str]] = []
        for condition in summary.conditions:
            below = summary.errors(BASELINE, key, condition.label)
            cells = [
                slashed([a / b for a, b in zip(above, below, strict=True)])
                if (above := summary.errors(slug, key, condition.label))
                else "–"  # noqa: RUF001
                for slug in slugs
            ]
            lines.append([condition.label or "all", *cells])
        parts.append(_table(head, lines))
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
                    summary, model, against, metrics=_ERRORS, condition=condition.label
                )
                lines.append(f"- {where}{worded_places(found, summary)}")
    return "\n".join(lines)


def identified(groups: Mapping[str, Identification]) -> str:
    """Return the parameters identified on each group of pushes, as tables."""
    machines = dict.fromkeys(described(each.manifest) for each in groups.values())
    parts = [f"Machine: {machine}." for machine in machines]
    for group, each in groups.items():
        rows = map(estimate_cells, each.found.estimates)
        parts += [f"**{group}**", _table(ESTIMATE_HEADINGS, rows)]
        parts.append("\n".join(f"- {s}" for s in estimate_sentences(each.found)))
    return "\n\n".join(parts)


def bench(found: Benchmark) -> str:
    """Return the figures of a benchmark case as a table, below their origin."""
    rows = (
        (f"`{name}`", f"{value:.4g}" if isinstance(value, float) else str(value))
        for name, value in found.figures.items()
    )
    note = f"{found.note} " if found.note else ""
    return f"{note}Machine: {found.machine}\n\n{_table(('figure', 'value'), rows)}"


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
    pages = {
        path.stem: _page(environment.get_template(path.name))
        for path in sorted(templates.glob("*.md.j2"))
        if path.stem != _INDEX
    }
    block = pages.pop(_README)
    titles = {name: page.title for name, page in pages.items()}
    table = findings(evidence, {Path(k).stem: v for k, v in titles.items()})
    index = environment.get_template(f"{_INDEX}.j2")
    pages[_INDEX] = _page(index, titles=titles, findings=table)
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
