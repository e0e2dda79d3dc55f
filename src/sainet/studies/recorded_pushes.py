"""The honest table on real recorded pushes: calibrate or learn, and from what?

Cross-validated: each push is predicted by models that saw neither it nor a repeat of
it. A network is told masses and radii and nothing of the table, so each surface has
models of its own, as a robot has that stands at one table; what one network for all of
them loses is said beside it.
"""

from collections.abc import Iterator
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np

from sainet.datasets.splits import Fold, fold_of_push, make_folds
from sainet.datasets.store import Store
from sainet.evaluation.evaluate import Evaluation
from sainet.evaluation.folds import join_folds
from sainet.evaluation.offsets import EndOffsets, end_offsets
from sainet.evaluation.rows import comparison_rows
from sainet.learning.recipes import Features, ModelKind
from sainet.report.figures.engine_errors import draw_engine_errors
from sainet.studies.chain import Chain
from sainet.studies.config import Scale
from sainet.studies.paper_setup import join
from sainet.studies.recorded_models import Inside, Learned, Tuner, Variant, surfaces_of

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


def run(scale: Scale, chain: Chain) -> dict[str, Any]:
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
    whole = replace(whole, errors=whole.errors | for_all.errors)
    tables = [*_tables(whole, store), *_elsewhere(store, scale, chain)]
    table = join(tables)
    table["published"] = [row for one in tables for row in one.get("published", ())]
    chain.finish(table)
    cases = dict(_engine_errors(store, scale, chain))
    draw_engine_errors(cases, chain.out / "engine-errors.svg")
    return table


def _engine_errors(
    store: Store, scale: Scale, chain: Chain
) -> Iterator[tuple[str, EndOffsets]]:
    """Yield what engines get wrong on each surface: nominal, and identified on it."""
    for surface, rows in surfaces_of(store).items():
        pushes = store.take(rows)
        tuner = Tuner(pushes, f"{surface}/whole", scale, chain)
        for engine, model in zip(("", ", identified"), tuner.physics(), strict=True):
            yield f"{surface}{engine}", end_offsets(model, pushes)


def _by_surface(fold: Fold, surface: str, scale: Scale, chain: Chain) -> Evaluation:
    """Return the errors of models that were made for one surface."""
    tuner = Tuner(fold.training, f"{surface}/fold-{fold.number}", scale, chain)
    return chain.compare([*tuner.physics(), *tuner.models(VARIANTS)], fold.tests)


def _for_all(fold: Fold, scale: Scale, chain: Chain) -> Evaluation:
    """Return the errors of models that were made for all surfaces at once."""
    tuner = Tuner(fold.training, f"every-surface/fold-{fold.number}", scale, chain)
    models = [
        replace(model, name=f"{model.name}-for-all") for model in tuner.models(FOR_ALL)
    ]
    return chain.compare(models, fold.tests)


def _tables(whole: Evaluation, store: Store) -> Iterator[dict[str, Any]]:
    """Yield the table of each surface and that over all."""
    surfaces = np.empty(store.info.pushes, object)
    for surface, rows in surfaces_of(store).items():
        surfaces[rows] = surface
    for groups in (tuple(surfaces), (_EVERYWHERE,) * store.info.pushes):
        yield told(replace(whole, groups=groups))


def told(evaluation: Evaluation) -> dict[str, Any]:
    """Return the table, each model and published one compared with one alone."""
    found = evaluation.to_dict()
    every = evaluation.errors | evaluation.published
    groups = np.array(evaluation.groups)
    found["comparisons"] = [
        row
        for group in dict.fromkeys(evaluation.groups)
        for name, errors in every.items()
        if name != TOLD
        for row in comparison_rows(
            (TOLD, every[TOLD].of_pushes(groups == group)),
            (name, errors.of_pushes(groups == group)),
            group=group,
            folds=evaluation.folds_of(groups == group),
        )
        if row["metric"].startswith("final")  # ends alone were observed
    ]
    return found


def _elsewhere(store: Store, scale: Scale, chain: Chain) -> Iterator[dict[str, Any]]:
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
        group = f"{_FROM} to {_TO}, {count} of it"
        yield told(_named(found, group))


def _few(store: Store, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return few of some pushes, and those that are no repeats of them."""
    repeats = store.repeats()[rows]
    order = np.argsort(fold_of_push(repeats, len(rows)), kind="stable")
    few = order[: min(FEW, len(rows) // 2)]
    seen = np.isin(repeats, repeats[few])
    return rows[few], rows[~seen]


def _named(evaluation: Evaluation, group: str) -> Evaluation:
    count = len(evaluation.groups)
    return replace(evaluation, groups=(group,) * count)
