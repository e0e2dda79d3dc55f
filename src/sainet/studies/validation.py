"""Is learning worth it on some pushes? A cross-validation, its verdict and its page."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import msgspec

from sainet.datasets import Scheme
from sainet.datasets.store import Store
from sainet.evaluation.as_json import to_json_object
from sainet.evaluation.coverage import coverage_of, in_words, to_json
from sainet.evaluation.measurements import Measurements
from sainet.evaluation.recommendation import Recommendation, recommend
from sainet.evaluation.summary import BASELINE, Summary, summarise
from sainet.models.identity import ModelId
from sainet.report.arrange import arrange
from sainet.report.pages.page import REPORT, Report, write_report
from sainet.report.palette import labels_of
from sainet.report.recommending import verdict
from sainet.report.table import Table
from sainet.studies.candidates import Candidate
from sainet.studies.cross_validation import PHYSICS_IDENTIFIED, cross_validated
from sainet.studies.runner import Runner
from sainet.studies.study import MEASUREMENTS


@dataclass(frozen=True)
class Validation:
    """Errors of models on pushes that they were not fitted to, and what to do."""

    measured: Measurements
    folds: tuple[str, ...]  # conditions, each a division into folds
    models: tuple[Candidate, ...]  # learned, from the simplest

    @property
    def order(self) -> list[str]:
        """The slugs of all models, from the simplest."""
        learned = [each.identity.slug for each in self.models]
        return [BASELINE, PHYSICS_IDENTIFIED.slug, *learned]

    @cached_property
    def summary(self) -> Summary:
        """Means with intervals, all models compared with the identified engine."""
        return summarise(self.measured, subject=PHYSICS_IDENTIFIED.slug)

    @cached_property
    def recommendation(self) -> Recommendation:
        """The model to use, and what it gains."""
        return recommend(summarise(self.measured), self.order, self.folds)

    @property
    def recommended(self) -> ModelId:
        """The identity of the model to use."""
        known = {model.slug: model for model in self.measured.header.models}
        return known[self.recommendation.model]

    @property
    def verdict(self) -> str:
        """The recommendation in words."""
        return verdict(self.recommendation, self.summary, self.order, self.folds)

    @property
    def table(self) -> Table:
        """The table of errors, with the verdict below it."""
        return replace(arrange(self.summary), verdicts=(self.verdict,))

    @property
    def coverage(self) -> list[str]:
        """Whether the regions of Gaussian processes hold, a sentence for each."""
        found = [c for c in coverage_of(self.measured) if c.condition in self.folds]
        return in_words(found, labels_of(self.summary.models))

    def to_json(self) -> Mapping[str, object]:
        """Return the JSON object that the command prints."""
        found = {
            "verdict": self.verdict,
            "recommendation": msgspec.to_builtins(self.recommendation),
            **to_json_object(self.summary),
        }
        return found | to_json(coverage_of(self.measured))

    def write(self, out: Path, data: Path) -> Path:
        """Write measurements and page, and return the path of the page."""
        self.measured.write(out / MEASUREMENTS)
        page = Report(
            title="Is learning worth it on these pushes?",
            subtitle=str(data),
            conclusion=self.verdict,
            summary="\n\n".join(self.coverage),
            table=self.summary,
        )
        return write_report(page, out / REPORT)


def cross_validate(
    store: Store,
    schemes: Sequence[Scheme],
    count: int,
    models: Sequence[Candidate],
    runner: Runner,
) -> Validation:
    """Fit every model in every fold, and test it on the pushes that were left out.

    Args:
        store: recorded pushes.
        schemes: divisions into folds.
        count: of the folds of each.
        models: learned models beside the engine as it is and the identified one.
        runner: of the steps; finished ones are not repeated.

    Raises:
        BadStore: the pushes do not suffice for so many folds, or for a model.
        BadInput: the inputs of a model are the same in all pushes.
    """
    measured = runner.result(cross_validated(store, schemes, count, models))
    return Validation(measured, tuple(schemes), tuple(models))
