"""Parts of the pages of results: tables, figures, and the pictures of the method."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from msgspec import structs

from sainet.evaluation.summary import BASELINE, Summary
from sainet.report.arrange import arrange
from sainet.report.figures.episodes import draw_side_by_side
from sainet.report.figures.overview import (
    Dot,
    Panel,
    Part,
    Section,
    draw_errors,
    draw_errors_over_physics,
    draw_panels,
    draw_success,
)
from sainet.report.palette import labels_of, styles_of
from sainet.report.pictures import draw_pictures
from sainet.report.writers import (
    ESTIMATE_HEADINGS,
    estimate_cells,
    estimate_sentences,
    to_markdown,
)
from sainet.studies import STUDIES, load_study
from sainet.studies.evidence import Benchmark, Evidence, Identification, described
from sainet.studies.study import Choice

ERRORS = ("pos_mm", "rot_deg")
_MAIN = (ERRORS, tuple(f"final_{key}" for key in ERRORS))  # columns; the first known
_MOST_DOTS = 50  # in the figure of a study without a figure of its own
TRANSCRIBED = "Transcribed by hand from what commands printed."

# Conditions of the overviews: title, study, label.
_ERRORS_OF = (
    ("Table I: a force, two disks", "direct-force-two-disks", ""),
    ("Table II: three disks", "direct-force-three-disks", ""),
    ("Table III: the robot, two disks", "robot-two-disks", ""),
    ("Table IV, in the virtual lab", "lab-prediction", "tests on ABS"),
)
_SUCCESS_OF = (
    ("Simulation, easy goals", "simulated-control", "easy, greedy"),
    ("Simulation, hard goals", "simulated-control", "hard, greedy"),
    ("Simulation, three disks, easy goals", "control-any-number", "3 disks, easy"),
    ("Virtual lab, easy goals", "lab-control", "easy"),
    ("Virtual lab, hard goals", "lab-control", "hard"),
    ("The same, larger weight of alignment", "lab-control", "hard, alignment 10"),
)

# Of a study with more conditions than a figure can show.
_DRAWN = {"recorded-trust": ("place", "direction", "side", "order", "kind")}


def main_table(summary: Summary, *labels: str) -> str:
    """Return the errors over pushes, or of their ends, or the trials, as Markdown.

    The complete table and the comparisons of models stand on the page of the site.

    Args:
        summary: of the measurements.
        labels: of conditions; none: all of them.
    """
    if labels:
        summary = structs.replace(
            summary,
            conditions=tuple(c for c in summary.conditions if c.label in labels),
            rows=tuple(e for e in summary.rows if e.condition in labels),
            predictions=tuple(e for e in summary.predictions if e.condition in labels),
            published=tuple(e for e in summary.published if e.condition in labels),
        )
    found = arrange(summary)
    known = {column.key for column in found.columns}
    keys = next((keys for keys in _MAIN if known & {*keys}), tuple(known))
    return to_markdown(replace(found.part(keys), sentences=()))


def choices(tried: Sequence[Choice], most: int | None = None) -> str:
    """Return the first settings that a study tried, with their scores, as a table."""
    return table(tried[0].cells, (each.cells.values() for each in tried[:most]))


def slashed(values: Sequence[float]) -> str:
    """Return values disk by disk: ``0.64 / 0.54``."""
    return " / ".join(f"{value:.2f}" for value in values)


def ratios(summary: Summary) -> str:
    """Return tables of errors over those of physics, disk by disk."""
    labels = labels_of(summary.models)
    slugs = dict.fromkeys(row.model for row in summary.rows if row.model != BASELINE)
    parts = []
    for key, name in zip(ERRORS, ("Position", "Rotation"), strict=True):
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
        parts.append(table(head, lines))
    return "\n\n".join(parts)


def identified(groups: Mapping[str, Identification]) -> str:
    """Return the parameters identified on each group of pushes, as tables."""
    machines = dict.fromkeys(described(each.manifest) for each in groups.values())
    parts = [f"Machine: {machine}." for machine in machines]
    for group, each in groups.items():
        rows = map(estimate_cells, each.found.estimates)
        parts += [f"**{group}**", table(ESTIMATE_HEADINGS, rows)]
        parts.append("\n".join(f"- {s}" for s in estimate_sentences(each.found)))
    return "\n\n".join(parts)


def draw_identified(groups: Mapping[str, Identification], path: Path) -> Path:
    """Draw the parameters identified on each group of pushes, with their intervals."""
    styles = styles_of(groups)
    dots: dict[str, list[Dot]] = {}
    for group, each in groups.items():
        for found in each.found.estimates:
            if found.doubt is None:
                dot = Dot(styles[group], found.value, found.low, found.high)
                dots.setdefault(found.name, []).append(dot)
    sections = [Section(name.replace("_", " "), each) for name, each in dots.items()]
    label = "value; camera offset in mm, the others without unit"
    return draw_panels([Panel(label, sections)], path)


def bench(found: Benchmark, names: Mapping[str, str]) -> str:
    """Return the figures of a benchmark case as a table, below their origin.

    Args:
        found: the figures.
        names: for readers, with units, in the order of the table.
    """
    rows = (
        (names.get(key, f"`{key}`"), _rounded(value))
        for key in dict.fromkeys([*names, *found.figures])
        if (value := found.figures.get(key)) is not None
    )
    origin = TRANSCRIBED if found.transcribed else ""
    text = " ".join(filter(None, [origin, found.note, f"Machine: {found.machine}"]))
    return f"{text}\n\n{table(('figure', 'value'), rows)}"


def _rounded(value: float | str) -> str:
    """Return four digits of a number, with commas; a text as it is."""
    return value if isinstance(value, str) else f"{float(f'{value:.4g}'):,.10g}"


def table(
    head: Iterable[str], rows: Iterable[Iterable[str]], *, align: str = "--:"
) -> str:
    """Return a table as Markdown, its first column on the left.

    Args:
        head: the headings.
        rows: the cells of each row.
        align: of the other columns.
    """
    head = list(head)
    lines = (head, (":--", *[align] * (len(head) - 1)), *rows)
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def parts_of(name: str, summary: Summary) -> list[Part]:
    """Return what the figure of a study shows: its conditions; empty: no figure.

    Args:
        name: of the study.
        summary: of its measurements.
    """
    dotted = summary.trials or [f for f in summary.factors if f.model != BASELINE]
    drawn = dict.fromkeys(each.condition for each in dotted)
    if not summary.trials and len({each.model for each in dotted}) == 1:
        drawn = {}  # nothing to compare
    if len(dotted) > _MOST_DOTS:
        drawn = [label for label in drawn if label in _DRAWN.get(name, ())]
    return [Part(label, summary, label) for label in drawn]


def figure_of(name: str, evidence: Evidence) -> str:
    """Return the default figure of a study as Markdown; empty: it has its own or none.

    Args:
        name: of the study, or of other measurements.
        evidence: of the studies.
    """
    summary = evidence.summary(name)
    if name not in STUDIES or load_study(name).figure or not parts_of(name, summary):
        return ""
    text = (
        "Goals solved, with 95 % intervals."
        if summary.is_of_trials
        else "Position errors, all disks together, over those of Physics, with 95 % "
        "intervals."
    )
    published = " Diamonds: published." if summary.published else ""
    return f"![{text}](../figures/{name}.svg)\n\n{text}{published}"


def draw_figures(evidence: Evidence, figures: Path) -> None:
    """Draw overviews and figures of studies from measurements, and the pictures."""

    def parts(of: Iterable[tuple[str, str, str]]) -> list[Part]:
        return [Part(title, evidence.summary(name), label) for title, name, label in of]

    draw_errors_over_physics(parts(_ERRORS_OF), figures / "errors-over-physics.svg")
    draw_success(parts(_SUCCESS_OF), figures / "goals-solved.svg")
    for name in STUDIES:
        study = load_study(name)
        if (summary := evidence.find(name)) is None:
            continue
        if study.figure is not None:
            study.figure(summary, figures / f"{name}.svg")
        elif shown := parts_of(name, summary):
            draw = draw_success if summary.is_of_trials else draw_errors_over_physics
            draw(shown, figures / f"{name}.svg")
    draw_errors(evidence.summary("recorded"), figures / "recorded.svg")
    draw_identified(evidence.identifications(), figures / "identified.svg")
    for goal, records in evidence.episodes().items():
        draw_side_by_side(records, figures / f"episodes-{goal}.svg")
    draw_pictures(figures)
