"""Errors of several models on the same pushes: verdict, rows, files."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from io import StringIO
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING

from msgspec.structs import astuple

from sainet.evaluation.claims import TRUE_PROPERTIES, places
from sainet.evaluation.coverage import Coverage, coverage_of
from sainet.evaluation.measurements import Measurements
from sainet.evaluation.summary import BASELINE, Row, Summary, summarise
from sainet.models.identity import LEARNED
from sainet.report import WRITERS
from sainet.report.arrange import arrange
from sainet.report.pages.page import Report, write_report
from sainet.report.table import Table
from sainet.report.verdicts import worded_places
from sainet.report.writers import print_table, to_html, write_table
from sainet.runs.errors import require_one_of

if TYPE_CHECKING:
    from pandas import DataFrame

_WIDTH = 160  # characters of the printed table
_PAGE = ".html"
_TOLD = ("pos_mm", "rot_deg")  # errors in sentences


@dataclass(frozen=True, repr=False)
class ErrorTable:
    """Errors of several models on the same pushes, with 95 % intervals.

    `print` shows it, a notebook draws it.

    Attributes:
        measured: every error of every push (mm, degrees).
    """

    measured: Measurements

    @cached_property
    def summary(self) -> Summary:
        """Means with intervals, and paired comparisons."""
        return summarise(self.measured)

    @cached_property
    def content(self) -> Table:
        """The cells of the table, comparisons and verdicts."""
        found = arrange(self.summary)
        return replace(found, verdicts=(*found.verdicts, *self._beside_others()))

    @property
    def rows(self) -> list[dict[str, str | float | None]]:
        """One row for each model and disk.

        `model`, `body` (1-based), `group` (empty: all), `n` (pushes), `trainings`; then
        each error by its name with unit, and its interval: `pos_mm`, `pos_mm_low`,
        `pos_mm_high` (mean over a push), `final_pos_mm` (its end), `rot_deg`, ...
        """
        found = (*self.summary.rows, *self.summary.predictions)
        return [{**_names(row), **_errors(row)} for row in found]

    @property
    def coverage(self) -> list[Coverage]:
        """Whether the 90 % regions of Gaussian processes hold the ends of pushes."""
        return coverage_of(self.measured)

    def verdict(self) -> str:
        """Return in sentences which model errs less, clearly or not.

        The best network beside physics; then each network beside physics that was
        identified and beside models of your own. Of pushes in groups, for each group.
        """
        return "\n".join(self.content.verdicts) or (
            "No verdict: it needs `physics` and another model in the table."
        )

    def _beside_others(self) -> Iterator[str]:
        """Yield in which errors networks are better or worse than other models."""
        summary = self.summary
        networks = [each.slug for each in summary.models if each.kind in LEARNED]
        engines = [each.slug for each in summary.models if each.kind == "physics"]
        others = [slug for slug in engines if slug not in (BASELINE, TRUE_PROPERTIES)]
        for condition in summary.conditions:
            where = f"{condition.label}: " if condition.label else ""
            for pair in product(networks, others):
                found = places(summary, *pair, metrics=_TOLD, condition=condition.label)
                yield f"{where}{worded_places(found, summary)}"

    def to_pandas(self) -> "DataFrame":
        """Return the rows as a pandas DataFrame."""
        from pandas import DataFrame

        return DataFrame(self.rows)

    def save(self, path: Path | str) -> Path:
        """Write the table to a file and return its path.

        Args:
            path: its ending decides the format: .html (a page that needs no other
                file), .md, .tex or .csv.

        Raises:
            BadSetting: the ending is another one.
            BadInput: the file cannot be written.
        """
        path = Path(path)
        require_one_of("path", path.suffix, WRITERS)
        if path.suffix != _PAGE:
            write_table(self.content, path)
            return path
        pushes, models = len(self.measured.data["row"]), len(self.summary.models)
        about = Report(
            title=path.stem,
            subtitle=f"Errors of {models} model{'s' * (models > 1)} on {pushes} pushes",
            summary="\n\n".join(self._beside_others()),
            table=self.summary,
        )
        return write_report(about, path)

    def __str__(self) -> str:
        """Return the table as text."""
        from rich.console import Console

        text = StringIO()
        console = Console(file=text, width=_WIDTH, highlight=False)
        print_table(self.content, console)
        return text.getvalue().rstrip()

    __repr__ = __str__

    def _repr_html_(self) -> str:
        """Return the table for notebooks."""
        return to_html(self.content)


def _names(row: Row) -> dict[str, str | float | None]:
    return {
        "model": row.model,
        "body": row.body,
        "group": row.condition,
        "n": row.count,
        "trainings": row.trainings,
    }


def _errors(row: Row) -> dict[str, str | float | None]:
    return {
        key + end: value
        for key, each in row.values.items()
        for end, value in zip(("", "_low", "_high"), astuple(each), strict=True)
    }
