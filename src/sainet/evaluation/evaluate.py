"""Several models on the same stored pushes, side by side."""

from collections.abc import Sequence
from functools import partial

import numpy as np

from sainet.datasets.schema import published_name
from sainet.datasets.store import Store, last_known
from sainet.evaluation import coverage, measurements, metrics
from sainet.evaluation.parts import Parts
from sainet.evaluation.predictions import (
    OnPushes,
    StoredPushes,
    predict_all,
    regions_of,
)
from sainet.models.card import Card
from sainet.models.identity import ModelId
from sainet.models.model import Model
from sainet.models.process_card import ProcessCard
from sainet.runs.errors import BadInput
from sainet.scenes.quantities import MOST_STEPS, require_count

PAPER_STEPS = 200


def evaluate(
    models: Sequence[Model],
    store: Store,
    *,
    steps: int | None = None,
    force: bool = False,
    on_pushes: OnPushes = lambda model, pushes: None,
    parts: Parts | None = None,
) -> measurements.Measurements:
    """Predict every stored push with every model and measure the errors.

    Args:
        models: at least one.
        store: the pushes.
        steps: to predict; 0 is all, None the paper's 200 (recorded pushes: all).
        force: use networks on other pushes than they were trained for.
        on_pushes: called with the model and the number of pushes predicted since.
        parts: keeps the errors of each model; None keeps nothing.

    Raises:
        BadCheckpoint: a network does not fit the pushes.
        BadInput: two models have the same name.
        Diverged: a prediction is not finite.
    """
    names = [model.name for model in models]
    if len(set(names)) < len(names):
        every = ", ".join(names)
        raise BadInput(f"`model`: {every} are not all different; rename one.")
    info = store.info
    fitted = any(model.card or model.identified for model in models)
    hashes = store.push_hashes() if fitted and not force else None
    for model in () if force else models:
        model.check_fits(
            info.kind, info.time_step, disks=info.bodies, seed=info.seed, pushes=hashes
        )
    pushes = StoredPushes(store, steps_to_predict(store, steps))
    made = {m.name: partial(_errors, m, pushes, on_pushes) for m in models}
    errors = [parts.errors(k, make) if parts else make() for k, make in made.items()]
    return _measurements(models, pushes, errors)


def steps_to_predict(store: Store, steps: int | None) -> int:
    """Return how many steps `evaluate` predicts, at most: see there."""
    if steps is None:
        recorded = store.info.is_recorded
        return store.info.steps if recorded else min(PAPER_STEPS, store.info.steps)
    require_count("steps", steps, low=0, high=MOST_STEPS)
    if steps > store.info.steps:
        raise BadInput(
            f"`steps` is {steps}; {store.path} has {store.info.steps} (0 takes all)."
        )
    return steps or store.info.steps


def _errors(model: Model, pushes: StoredPushes, on_pushes: OnPushes) -> metrics.Errors:
    store, longest = pushes.store, pushes.exists.shape[1]
    given = model.dynamics.recall(store.push_hashes, longest, store.info.bodies)
    if given is None:
        poses = predict_all(model, pushes, on_pushes)
        return pushes.errors(poses) | _coverage(model, pushes, poses)
    on_pushes(model.name, len(given))
    if given.ndim == pushes.final.ndim:
        return metrics.final_errors(given, pushes.final)
    return pushes.errors(given)


def _coverage(model: Model, pushes: StoredPushes, poses: np.ndarray) -> metrics.Errors:
    """Return the measurements of the regions in which the model expects the ends."""
    ends = last_known(poses, pushes.observed)
    found: metrics.Errors = {}
    for rows, region in regions_of(model.dynamics, pushes):
        measured = coverage.measured(region, ends[rows], pushes.final[rows])
        for name, values in measured.items():
            found.setdefault(name, np.empty(ends.shape[:2]))[rows] = values
    return found


def _measurements(
    models: Sequence[Model], pushes: StoredPushes, errors: list[metrics.Errors]
) -> measurements.Measurements:
    store, arrays, final = pushes.store, pushes.arrays, pushes.final
    errors = errors + [
        metrics.final_errors(arrays[published_name(name)].astype(np.float64), final)
        for name in store.info.published
    ]
    groups = store.info.groups
    labels = sorted({groups[code] for code in arrays["group"]}) if groups else [""]
    places = [labels.index(groups[code] if groups else "") for code in arrays["group"]]
    rows = np.arange(store.info.pushes) if store.rows is None else np.array(store.rows)
    unknown = np.full(final.shape[:2], np.nan)
    names = dict.fromkeys(name for each in errors for name in each)
    return measurements.measurements_of(
        {k: np.stack([each.get(k, unknown)[None] for each in errors]) for k in names},
        metrics.travel_mm(arrays["initial"][..., :3].astype(np.float64), final),
        _header(models, store, labels),
        condition=np.array(places),
        row=rows,
    )


def _header(
    models: Sequence[Model], store: Store, labels: Sequence[str]
) -> measurements.Header:
    published = store.info.published
    kind = "recorded" if store.info.is_recorded else "simulated"
    return measurements.Header(
        models=(
            *(model.id for model in models),
            *(ModelId(kind="published", name=name) for name in published),
        ),
        predictions=tuple(published),
        conditions=tuple(measurements.Condition(label=label) for label in labels),
        reference_m=metrics.REFERENCE_DISTANCE[kind],
        provenance=measurements.Provenance(
            tests=tuple(
                measurements.TestSet(condition=c, data=store.content) for c in labels
            ),
            trainings=tuple(_training(m.name, m.card) for m in models if m.card),
        ),
    )


def _training(name: str, card: Card | ProcessCard) -> measurements.TrainingRun:
    return measurements.TrainingRun(
        model=name,
        seed=card.recipe.seed,
        weights=card.weights,
        data=card.data,
        iterations=card.recipe.iterations,
        final_loss=card.final_loss,
    )
