"""Cross-validation in scripts."""

from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from functools import cached_property
from os import PathLike
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import get_args

from sainet.api.progress import shown_progress
from sainet.api.pushes import Dataset, store_of
from sainet.api.table import ErrorTable
from sainet.datasets import Scheme
from sainet.evaluation.recommendation import Recommendation
from sainet.report.table import Table
from sainet.runs.errors import require_one_of
from sainet.scenes.quantities import require_count
from sainet.studies import USUAL_CANDIDATES, CandidateName
from sainet.studies.candidates import candidates_named
from sainet.studies.runner import Progress, Runner
from sainet.studies.study import STEPS
from sainet.studies.validation import Validation
from sainet.studies.validation import cross_validate as validate


@dataclass(frozen=True, repr=False)
class CrossValidation(ErrorTable):
    """Errors of models on pushes that they were not fitted to, and what to do.

    `print` shows the table; `verdict()` returns whether learning is worth it.
    """

    found: Validation

    @property
    def recommendation(self) -> Recommendation:
        """The model to use, and how much less it errs, with 95 % intervals."""
        return self.found.recommendation

    @cached_property
    def content(self) -> Table:
        """The cells of the table, comparisons and the verdict."""
        return self.found.table

    def verdict(self) -> str:
        """Return the recommended model and what it gains, in words."""
        return self.found.verdict


def cross_validate(
    pushes: Dataset,
    *,
    by: Scheme | Sequence[Scheme] = "chain",
    folds: int = 5,
    models: CandidateName | Sequence[CandidateName] = USUAL_CANDIDATES,
    out: PathLike[str] | str | None = None,
    progress: bool | None = None,
) -> CrossValidation:
    """Find out whether identification or learning is worth it on some pushes.

    Each push is predicted by models that were fitted without it: the engine as it is,
    the identified engine, and learned models around the latter.

    Args:
        pushes: recorded, at one table; each surface has models of its own.
        by: divisions into folds. `kind` keeps repeats of a push together, `chain` also
            pushes that start where another one ended; `place`, `direction`, `side` (of
            the disk) and `order` (of recording) test where nothing was learned.
        folds: number of folds, at least 2.
        models: learned models: Gaussian processes (`gp-angle`, `gp-side`, `gp-place`;
            with `-chosen`, the inputs up to these and the kernel are chosen in each
            fold) and networks (`sain`, `sain-place`; with `-ensemble`, the mean of
            five with regions).
        out: folder of the fitted models; an identical call resumes. None: a temporary
            folder, deleted at the end.
        progress: show progress bars; None: on a terminal.

    Raises:
        BadStore: the pushes do not suffice for so many folds, or for a model.
        BadInput: the inputs of a model are the same in all pushes.
        UnknownName: no model has one of the names.
    """
    require_count("folds", folds, low=2)
    schemes: Sequence[Scheme] = (by,) if isinstance(by, str) else tuple(by)
    for scheme in schemes:
        require_one_of("by", scheme, get_args(Scheme))
    names = (models,) if isinstance(models, str) else models
    store, chosen = store_of(pushes), candidates_named(names)
    with ExitStack() as stack:
        folder = stack.enter_context(TemporaryDirectory()) if out is None else out
        advance = stack.enter_context(
            shown_progress("Cross-validating", None, progress)
        )

        def report(event: Progress) -> None:
            advance(int(event.has_ended), event.title)

        runner = Runner(Path(folder) / STEPS, report=report)
        found = validate(store, schemes, folds, chosen, runner)
    return CrossValidation(found.measured, found)
