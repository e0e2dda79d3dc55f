"""The report of the whole paper: every study on one page, and what was not run."""

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import msgspec

from sainet.report.pages.page import Part, PlainTable, Report
from sainet.report.verdicts import rulings
from sainet.runs.documents import read_document
from sainet.runs.manifest import manifest
from sainet.studies import STUDIES, Scale, load_study
from sainet.studies.conclusions import HEADINGS, conclude, rows_of
from sainet.studies.durations import Clock, in_words
from sainet.studies.effort import effort
from sainet.studies.run_report import figures_of
from sainet.studies.steps import Step
from sainet.studies.study import TABLE, Result

_OF_QUICK = (
    "The quick scale shows that every study runs. Its networks have hardly been "
    "trained: neither its numbers nor its rulings can be compared with the paper's."
)


def folder_of(out: Path, name: str, scale: Scale) -> Path:
    """Return the folder of a study."""
    return out / f"{name}-{scale}"


def whole_report(
    out: Path,
    scale: Scale,
    not_run: Mapping[str, str],
    steps: Iterable[Step[Any]],
    clock: Clock,
    *,
    command: str,
) -> Report:
    """Return the report of all studies that were run in a folder, at one scale.

    Args:
        out: the folder.
        scale: of the studies.
        not_run: why a study could not be run, by its name.
        steps: of the studies, whose durations are listed.
        clock: has the durations.
        command: that runs the studies.

    Raises:
        BadInput: a result is damaged.
    """
    found = {
        name: read_document(path, Result)
        for name in STUDIES
        if (path := folder_of(out, name, scale) / TABLE).is_file()
    }
    missing = {name: "not asked for" for name in STUDIES if name not in found}
    missing |= {name: why for name, why in not_run.items() if name in missing}
    concluded = conclude(lambda study: found[study].summary if study in found else None)
    return Report(
        title="The whole paper",
        subtitle=f"{len(found)} of {len(STUDIES)} studies, at the scale {scale}",
        summary=_OF_QUICK if scale == "quick" else "",
        plain_tables=(
            PlainTable(
                title="The paper's claims",
                note="A claim holds if each error that it is about is clearly smaller.",
                columns=HEADINGS,
                rows=rows_of(concluded),
            ),
            PlainTable(
                title="Not run",
                note="" if missing else "Every study was run.",
                columns=("study", "reason"),
                rows=list(missing.items()),
            ),
            _durations(steps, clock),
        ),
        parts=[
            _part(name, result, folder_of(out, name, scale))
            for name, result in found.items()
        ],
        manifest=msgspec.to_builtins(manifest()),
        commands=(command,),
    )


def _part(name: str, result: Result, folder: Path) -> Part:
    study = load_study(name)
    return Part(
        name=name,
        question=study.question,
        table=result.summary,
        sentences=rulings(study.claims, result.summary),
        figures=tuple(figures_of(folder)),
    )


def _durations(steps: Iterable[Step[Any]], clock: Clock) -> PlainTable:
    """Return the number and the durations of the steps of each kind of work."""
    taken: defaultdict[str, list[float]] = defaultdict(list)
    for step in steps:
        if (took := clock.duration(step)) is not None:
            taken[effort(step).kind].append(took.seconds)
    total = sum(map(sum, taken.values()))
    return PlainTable(
        title="Durations",
        note=f"In all {in_words(total)}, also of earlier commands in this folder.",
        columns=("work", "steps", "in all", "longest"),
        rows=list(_rows(taken)),
    )


def _rows(taken: Mapping[str, list[float]]) -> Iterator[tuple[str, ...]]:
    for kind, seconds in sorted(taken.items(), key=lambda pair: -sum(pair[1])):
        yield kind, str(len(seconds)), f"{sum(seconds):.0f} s", f"{max(seconds):.0f} s"
