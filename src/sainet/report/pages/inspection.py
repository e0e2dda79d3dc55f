"""The inspection of a dataset as sentences and as a page."""

from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

from sainet.datasets.facts import Facts
from sainet.datasets.inspection import Inspection, Range, quantities_of
from sainet.datasets.store import Store
from sainet.report.figures.recordings import draw_histograms, draw_pushes, drawn_rows
from sainet.report.pages.page import PlainTable, Report, write_report
from sainet.runs.documents import read_json
from sainet.runs.folders import CONFIG

MOST_LISTED = 500  # doubts on a page
_NO_DOUBT = "No recording is doubtful."


def sentences_of(found: Inspection) -> Iterator[str]:
    """Yield what the dataset contains, one sentence each."""
    origin = "recorded" if found.engine == "recorded" else f"made by {found.engine}"
    disks = f"{found.disks} disk{'s' * (found.disks > 1)}"
    yield f"{found.pushes} pushes of {disks}, {origin}, setup {found.setup}."
    if found.groups:
        each = ", ".join(f"{name} ({count})" for name, count in found.groups.items())
        yield f"Groups: {each}."
    yield (
        f"The time step is {1e3 * found.time_step:.3f} ms; the poses are known at "
        f"{100 * found.observed:.3g} % of the steps."
    )
    yield (
        f"{found.repeats} pushes have repeats; {found.chained} start within 0.3 mm of "
        "where another push ended."
    )
    yield doubts_in_words(found)


def doubts_in_words(found: Inspection) -> str:
    """Return how many recordings are doubtful, and why."""
    if not found.doubts:
        return _NO_DOUBT
    rows = len({doubt.row for doubt in found.doubts})
    reasons = Counter(doubt.reason for doubt in found.doubts).most_common()
    why = ", ".join(f"{reason} ({count})" for reason, count in reasons)
    verb = "recording is" if rows == 1 else "recordings are"
    return f"{rows} {verb} doubtful: {why}."


def range_cells(found: Range) -> tuple[str, ...]:
    """Return name with unit, least, median and largest value as texts."""
    name = f"{found.name} ({found.unit})" if found.unit else found.name
    values = (found.low, found.median, found.high)
    return name, *(f"{round(value, 3):.4g}" for value in values)


def write_inspection(
    store: Store, facts: Facts, found: Inspection, path: Path, *, command: str
) -> Path:
    """Write the page of a dataset atomically and return its path.

    Args:
        store: the dataset.
        facts: of its pushes.
        found: its summary.
        path: of the page.
        command: that makes the page.

    Raises:
        BadInput: the page cannot be written.
    """
    doubtful = [doubt.row for doubt in found.doubts]
    drawn = len(drawn_rows(found.pushes, doubtful))
    part = "All" if drawn == found.pushes else f"{drawn} of {found.pushes}"
    with TemporaryDirectory() as folder:
        table = draw_pushes(facts, doubtful, Path(folder) / "table.svg")
        histograms = Path(folder) / "histograms.svg"
        draw_histograms(quantities_of(facts), histograms)
        report = Report(
            title=store.path.resolve().name,
            subtitle="Inspection of a dataset of pushes",
            summary="\n\n".join(sentences_of(found)),
            figures=[
                (table, f"{part} pushes on the table, seen from above."),
                (histograms, "The quantities that vary."),
            ],
            plain_tables=[_doubts(found), _ranges(found)],
            manifest=read_json(store.path / CONFIG),
            commands=(command,),
        )
        return write_report(report, path)


def _doubts(found: Inspection) -> PlainTable:
    more = len(found.doubts) - MOST_LISTED
    note = f"The first {MOST_LISTED}; {more} more are in the JSON output. " * (more > 0)
    return PlainTable(
        title="Doubtful recordings",
        note=note + ("Rows are counted from 0." if found.doubts else _NO_DOUBT),
        columns=("row", "group", "reason", "what to check"),
        rows=[
            (str(each.row), each.group, each.reason, each.text)
            for each in found.doubts[:MOST_LISTED]
        ],
    )


def _ranges(found: Inspection) -> PlainTable:
    is_recorded = found.engine == "recorded"
    note = "Masses, radii and frictions are those that the import was given."
    return PlainTable(
        title="Ranges",
        note=note if is_recorded else "",
        columns=("quantity", "least", "median", "largest"),
        rows=[range_cells(each) for each in found.ranges],
    )
