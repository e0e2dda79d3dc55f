"""Evaluation of several models on the same pushes, in scripts."""

import logging

from sainet.api.abstention import Models, rows_of
from sainet.api.progress import shown_progress
from sainet.api.pushes import Dataset, store_of
from sainet.api.table import ErrorTable
from sainet.evaluation import evaluate as evaluation
from sainet.evaluation.abstention import measure
from sainet.evaluation.unlike import unlike_pushes
from sainet.models.model import Model
from sainet.runs.errors import BadInput

_log = logging.getLogger(__name__)


def evaluate(
    models: Models,
    pushes: Dataset,
    *,
    steps: int | None = None,
    force: bool = False,
    progress: bool | None = None,
) -> ErrorTable:
    """Predict every push with every model and return the errors.

    Args:
        models: by the names that the table gives them, or without such names; each as
            `load` takes it, or from `abstaining`. The model called `physics` is the one
            that others are compared with.
        pushes: to predict; a dataset or its folder.
        steps: to predict; 0: all, None: the paper's 200, of recorded pushes all.
        force: use networks on other pushes than they were trained for.
        progress: show a progress bar; None: on a terminal.

    Raises:
        BadCheckpoint: a network does not fit the pushes, or was trained on them.
        BadInput: two models have the same name, or one abstains and the pushes have no
            groups.
        Diverged: a prediction is not finite.
    """
    if isinstance(models, str | Model):
        raise BadInput(
            f"`models` is '{models}'; give a list, or a model for each name."
        )
    store, found = store_of(pushes), list(rows_of(models))
    for warning in unlike_pushes([e for e in found if isinstance(e, Model)], store):
        _log.warning("%s", warning)

    def run(plain: list[Model]) -> evaluation.measurements.Measurements:
        total = store.info.pushes * len(plain)
        with shown_progress("Predicting", total, progress) as advance:
            return evaluation.evaluate(
                plain,
                store,
                steps=steps,
                force=force,
                on_pushes=lambda model, count: advance(count, model),
            )

    return ErrorTable(measure(found, store, run))
