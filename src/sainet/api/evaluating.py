"""Evaluation of several models on the same pushes, in scripts."""

import logging
from collections.abc import Iterator, Mapping, Sequence

from sainet.api.models import Loadable, load
from sainet.api.progress import shown_progress
from sainet.api.pushes import Dataset, store_of
from sainet.api.table import ErrorTable
from sainet.evaluation import evaluate as evaluation
from sainet.evaluation.unlike import unlike_pushes
from sainet.models.model import Model
from sainet.runs.errors import BadInput

Models = Mapping[str, Loadable] | Sequence[Loadable]
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
            `load` takes it. The model called `physics` is the one that others are
            compared with.
        pushes: to predict; a dataset or its folder.
        steps: to predict; 0: all, None: the paper's 200, of recorded pushes all.
        force: use networks on other pushes than they were trained for.
        progress: show a progress bar; None: on a terminal.

    Raises:
        BadCheckpoint: a network does not fit the pushes, or was trained on them.
        BadInput: two models have the same name.
        Diverged: a prediction is not finite.
    """
    if isinstance(models, str):
        raise BadInput(
            f"`models` is '{models}'; give a list, or a model for each name."
        )
    store, found = store_of(pushes), list(_named(models))
    for warning in unlike_pushes(found, store):
        _log.warning("%s", warning)
    total = store.info.pushes * len(found)
    with shown_progress("Predicting", total, progress) as advance:
        measured = evaluation.evaluate(
            found,
            store,
            steps=steps,
            force=force,
            on_pushes=lambda model, count: advance(count, model),
        )
    return ErrorTable(measured)


def _named(models: Models) -> Iterator[Model]:
    if isinstance(models, Mapping):
        return (load(model).called(name) for name, model in models.items())
    return map(load, models)
