"""The honest table on real recorded pushes: calibrate or learn, and from what?

Cross-validated: each push is predicted by models that saw neither it nor a repeat of
it. A network is told masses and radii and nothing of the table, so each surface has
models of its own, as a robot has that stands at one table; what one network for all of
them loses is said beside it.
"""

from collections.abc import Iterator
from dataclasses import replace
from itertools import product

import numpy as np

from sainet.datasets.splits import Fold, fold_of_push, make_folds
from sainet.datasets.store import Store
from sainet.evaluation.conditions import Condition
from sainet.evaluation.evaluate import EndOffsets, end_offsets
from sainet.evaluation.joining import (
    add_models,
    join,
    join_folds,
    without_predictions,
)
from sainet.evaluation.measurements import Measurements
from sainet.evaluation.summary import summarise
from sainet.learning.recipes import Features, ModelKind
from sainet.models.identity import identity_named
from sainet.report.figures.engine_errors import draw_engine_errors
from sainet.studies.chain import Chain
from sainet.studies.config import Scale
from sainet.studies.recorded_models import Inside, Learned, Tuner, Variant, surfaces_of
from sainet.studies.result import Result

FOLDS = {"quick": 2, "paper": 5}
NETWORKS: tuple[tuple[ModelKind, Inside], ...] = (
    ("in", "nominal"),
    ("sain", "nominal"),
    ("sain", "identified"),
)
# What learns from recorded pushes alone: SAIN has an engine to add to, IN has none.
ALONE: tuple[tuple[ModelKind, Learned, Inside], ...] = (
    ("in", "real", "nominal"),
    ("sain", "residual", "nominal"),
    ("sain", "residual", "identified"),
)
FEATURES: tuple[Features, ...] = ("paper", "place")
VARIANTS = (
    *(Variant(network, "simulation", engine) for network, engine in NETWORKS),
    *(
        Variant(network, "tuned", engine, features)
        for features, (network, engine) in product(FEATURES, NETWORKS)
    ),
    *(Variant(*alone, features) for features, alone in product(FEATURES, ALONE)),
    Variant("sain", "real"),  # in the paper's form, to see what the residual one gives
)
FOR_ALL = tuple(
    Variant("sain", "residual", "identified", features) for features in FEATURES
)
ELSEWHERE = tuple(
    each for each in VARIANTS if each.features == "paper" and each.learned != "real"
)
TOLD = "sain-identified-residual"  # the row that others are compared with
FEW = 50  # pushes of a surface that a network was not made for
_EVERYWHERE, _FROM, _TO = "all", "abs", "plywood"


def run(scale: Scale, chain: Chain) -> Result:
    """Tune, train and identify on each fold; returns the table.

    Args:
        scale: `paper` has five folds and every iteration.
        chain: does the steps; it knows the recorded pushes.

    Raises:
        BadInput: no recorded pushes were given.
    """
    store = chain.recorded_pushes()
    whole = join_folds(
        [
            (fold, _by_surface(fold, surface, scale, chain))
            for surface, rows in surfaces_of(store).items()
            for fold in make_folds(store, FOLDS[scale], rows)
        ]
    )
    for_all = join_folds(
        [
            (fold, _for_all(fold, scale, chain))
            for fold in make_folds(store, FOLDS[scale])
        ]
    )
    whole = _with_surfaces(add_models(whole, without_predictions(for_all)), store)
    found = join([whole, *_elsewhere(store, scale, chain)])
    result = Result(summary=summarise(found, subject=TOLD))
    chain.finish(result, measurements=found)
    cases = dict(_engine_errors(store, scale, chain))
    draw_engine_errors(cases, chain.out / "engine-errors.svg")
    return result


def _engine_errors(
    store: Store, scale: Scale, chain: Chain
) -> Iterator[tuple[str, EndOffsets]]:
    """Yield what engines get wrong on each surface: nominal, and identified on it."""
    for surface, rows in surfaces_of(store).items():
        pushes = store.take(rows)
        tuner = Tuner(pushes, f"{surface}/whole", scale, chain)
        for engine, model in zip(("", ", identified"), tuner.physics(), strict=True):
            yield f"{surface}{engine}", end_offsets(model, pushes)


def _by_surface(fold: Fold, surface: str, scale: Scale, chain: Chain) -> Measurements:
    """Return the errors of models that were made for one surface."""
    tuner = Tuner(fold.training, f"{surface}/fold-{fold.number}", scale, chain)
    return chain.compare([*tuner.physics(), *tuner.models(VARIANTS)], fold.tests)


def _for_all(fold: Fold, scale: Scale, chain: Chain) -> Measurements:
    """Return the errors of models that were made for all surfaces at once."""
    tuner = Tuner(fold.training, f"every-surface/fold-{fold.number}", scale, chain)
    models = [
        replace(model, id=identity_named(f"{model.name}-for-all"))
        for model in tuner.models(FOR_ALL)
    ]
    return chain.compare(models, fold.tests)


def _with_surfaces(whole: Measurements, store: Store) -> Measurements:
    """Return measurements with a condition for each surface, and one for all."""
    surfaces = surfaces_of(store)
    names = sorted(surfaces)
    places = np.empty(store.info.pushes, np.int32)
    for name, rows in surfaces.items():
        places[rows] = names.index(name)
    conditions = [Condition(label=name, factors={"surface": name}) for name in names]
    everywhere = Condition(label=_EVERYWHERE, parts=tuple(names))
    return whole.in_conditions((*conditions, everywhere), places)


def _elsewhere(store: Store, scale: Scale, chain: Chain) -> Iterator[Measurements]:
    """Yield what models of one surface do on another: without any push of it, with few.

    Both are tested on the same pushes, those that neither has seen.
    """
    surfaces = surfaces_of(store)
    if not {_FROM, _TO} <= surfaces.keys():
        return
    few, tests = _few(store, surfaces[_TO])
    for count, rows in ((0, surfaces[_FROM]), (FEW, np.append(surfaces[_FROM], few))):
        folder = f"{_FROM}-to-{_TO}-with-{count}"
        tuner = Tuner(store.take(rows), folder, scale, chain)
        models = [*tuner.physics(), *tuner.models(ELSEWHERE)]
        found = chain.compare(models, store.take(tests))
        label = f"{_FROM} to {_TO}, {count} of it"
        factors = {"surface": _TO, "trained_on": _FROM, "training_pushes": count}
        yield found.in_condition(Condition(label=label, factors=factors))


def _few(store: Store, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return few of some pushes, and those that are no repeats of them."""
    repeats = store.repeats()[rows]
    order = np.argsort(fold_of_push(repeats, len(rows)), kind="stable")
    few = order[: min(FEW, len(rows) // 2)]
    seen = np.isin(repeats, repeats[few])
    return rows[few], rows[~seen]
