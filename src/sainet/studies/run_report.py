"""The report of a run folder, for the outputs of any command."""

import shlex
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import msgspec

from sainet.control.record import episode_files, read_record
from sainet.datasets.schema import HASHES
from sainet.models.card import CARD, IDENTIFIED, Identified, read_identified
from sainet.report.about_models import read_any_card, sentences_of
from sainet.report.pages.page import REPORT, Report, to_page
from sainet.report.writers import estimate_cells, estimate_sentences
from sainet.runs.documents import read_document, read_json
from sainet.runs.errors import BadInput
from sainet.runs.folders import CONFIG
from sainet.runs.manifest import MANIFEST
from sainet.studies import STUDIES
from sainet.studies.study import TABLE, Result

_EPISODES = 6  # that play
# The figures that commands leave in their folders, and their captions.
_FIGURES = {
    **{name: f"Errors in the study {name}." for name in STUDIES},
    "learning-curve": "The loss while the network learned.",
    "paths": "Predicted paths of one push against the true one.",
    "error-over-time": "Mean position error of each disk over the time of a push.",
    "episodes": "Shapes at the start (faint) and at the end, and the goal.",
    "data-efficiency": "Errors over training pushes, as many iterations for all.",
    "recorded-few": "Errors over recorded training pushes.",
    "recorded-active": "Errors over pushes that are chosen or drawn at random.",
    "lab-active": "Errors over pushes that are chosen or drawn at random.",
    "lab-prediction": "Errors over training pushes in the virtual labs.",
    "engine-errors": "Errors of engines at the end of a push, by place and direction.",
}


def report_of(folder: Path) -> Report:
    """Collect what a run folder holds: table, figures, episodes, cards.

    Raises:
        BadInput: there is no such folder, nothing to show in it, or what is there is
            damaged.
    """
    if not folder.is_dir():
        raise BadInput(f"{folder}: no such folder; give one that sainet made.")
    found = folder / TABLE
    table = read_document(found, Result).summary if found.is_file() else None
    card = msgspec.to_builtins(read_any_card(folder)) or {}
    for name in ("pushes", "seal"):  # hashes, which no reader compares
        card.pop(name, None)
    is_identified = (folder / IDENTIFIED).is_file()
    estimates = _estimates(read_identified(folder)) if is_identified else ()
    sentences = (*sentences_of(folder), *estimates)
    episodes = [read_record(path) for path in episode_files(folder)[:_EPISODES]]
    figures = tuple(figures_of(folder))
    if not (table or card or is_identified or episodes or figures):
        raise BadInput(f"{folder}: nothing to show in it{_way_out(folder)}.")
    settings: dict[str, Any] = {**_json(folder / CONFIG), **card}
    made = settings.pop("manifest", None) or _json(folder / MANIFEST)
    command = settings.get("command")
    return Report(
        title=folder.resolve().name,
        subtitle=f"Output of 'sainet {command}'" if command else "",
        summary="\n\n".join(sentences),
        table=table,
        figures=figures,
        episodes=episodes,
        manifest=settings | made,
        commands=(shlex.join(["sainet", "report", str(folder)]),),
    )


def is_of_demo(folder: Path) -> bool:
    """Whether the demo made the folder: its own report contains more."""
    return (
        _json(folder / CONFIG).get("command") == "demo" and (folder / REPORT).exists()
    )


def page_of(folder: Path) -> str:
    """Return the report of a run folder as one HTML page.

    Raises:
        BadInput: see `report_of`.
    """
    try:
        return to_page(report_of(folder))
    except (KeyError, IndexError, TypeError, ValueError, AttributeError) as error:
        raise BadInput(
            f"{folder}: its contents are damaged or of another program "
            f"({type(error).__name__}: {error}); make it again."
        ) from error


def _json(path: Path) -> dict[str, object]:
    return read_json(path) if path.is_file() else {}


def figures_of(folder: Path) -> Iterator[tuple[Path, str]]:
    """Yield the figures that a command left in a folder, with captions."""
    for name, caption in _FIGURES.items():
        if (folder / f"{name}.svg").is_file():
            yield folder / f"{name}.svg", caption


def _estimates(identified: Identified) -> Iterator[str]:
    """Yield estimates and errors, in sentences."""
    for estimate in identified.estimates:
        if not estimate.doubt:
            name, before, value, interval = estimate_cells(estimate)
            yield f"{name.capitalize()}: {value} ({interval}), initially {before}."
    yield from estimate_sentences(identified)


def _way_out(folder: Path) -> str:
    """Name what shows the folder, or folders in it that have something to show."""
    if (folder / REPORT).is_file():
        return f"; open {folder / REPORT}"
    if (folder / HASHES).is_file():
        return f"; 'sainet inspect {shlex.quote(str(folder))}' describes its pushes"
    known = sorted(path.parent for path in folder.glob(f"*/{TABLE}"))
    known += sorted(path.parent for path in folder.glob(f"*/{CARD}"))
    return f"; give, for example, {known[0]}" if known else ""
