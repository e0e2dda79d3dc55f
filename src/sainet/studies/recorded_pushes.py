"""Cross-validated comparison on recorded pushes: identify the engine, or learn?

Each push is predicted by models that were trained neither on it nor on a repeat of it.
A network takes masses and radii as inputs, but nothing of the table, so each surface
has models of its own, like a robot at one table; the errors of one network for all
surfaces stand beside them.
"""

from collections.abc import Iterator
from dataclasses import field
from itertools import product

import numpy as np

from sainet.datasets.splits import Fold, fold_of_push, make_folds
from sainet.datasets.store import Store
from sainet.evaluation.claims import Claim, errs_less
from sainet.evaluation.joining import add_models, join_folds, without_predictions
from sainet.evaluation.measurements import Condition, Measurements
from sainet.evaluation.predictions import EndOffsets, end_offsets
from sainet.models.identity import Features, ModelKind
from sainet.models.model import Model
from sainet.studies.recorded_models import (
    Inside,
    Learned,
    TunedModels,
    Variant,
    surfaces_of,
)
from sainet.studies.runner import Runner
from sainet.studies.steps import Apart, Evaluate, Given, Join, Step
from sainet.studies.study import RECORDED, Plan, Scope, Study

FOLDS = {"quick": 2, "paper": 5}
NETWORKS: tuple[tuple[ModelKind, Inside], ...] = (
    ("in", "nominal"),
    ("sain", "nominal"),
    ("sain", "identified"),
)
# Trained only on recorded pushes: SAIN adds to its internal engine, IN has none.
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
    Variant("sain", "real"),  # the paper's form, to see the effect of the additive form
)
FOR_ALL = tuple(
    Variant("sain", "residual", "identified", features) for features in FEATURES
)
ELSEWHERE = tuple(
    each for each in VARIANTS if each.features == "paper" and each.learned != "real"
)
# The row that others are compared with.
SUBJECT = Variant("sain", "residual", "identified").identity().slug
FEW = 50  # pushes of a surface that a network was not made for
_EVERYWHERE, _FROM, _TO = "all", "abs", "plywood"


class JoinFolds(Step[Measurements]):
    """Measurements of all folds of a cross-validation."""

    parts: tuple[Step[Measurements], ...]
    folds: tuple[Fold, ...] = field(repr=False)  # of the parts, which identify them
    condition: Condition | None = None

    def run(self, runner: Runner) -> Measurements:
        """Return the measurements in one condition, if one is given."""
        measured = map(runner.result, self.parts)
        found = join_folds([*zip(self.folds, measured, strict=True)])
        return found if self.condition is None else found.in_condition(self.condition)


class BySurface(Step[Measurements]):
    """Measurements with a condition for each surface, and one for all surfaces."""

    own: JoinFolds  # by models of one surface
    for_all: JoinFolds  # by models of all surfaces
    pushes: Given

    def run(self, runner: Runner) -> Measurements:
        """Return the measurements of both kinds of models."""
        for_all = without_predictions(runner.result(self.for_all))
        whole = add_models(runner.result(self.own), for_all)
        surfaces = surfaces_of(self.pushes.store)
        names = sorted(surfaces)
        places = np.empty(self.pushes.store.info.pushes, np.int32)
        for name, rows in surfaces.items():
            places[rows] = names.index(name)
        own = (Condition(label=name, factors={"surface": name}) for name in names)
        everywhere = Condition(label=_EVERYWHERE, parts=tuple(names))
        return whole.in_conditions((*own, everywhere), places)


class EndErrors(Apart[EndOffsets]):
    """Signed errors of an engine at the ends of pushes."""

    model: Step[Model]
    pushes: Step[Store]

    def run(self, runner: Runner) -> EndOffsets:
        """Return the errors."""
        return end_offsets(runner.result(self.model), runner.result(self.pushes))


def _plan(scope: Scope) -> Plan:
    """Return models that are tuned, trained and identified on each fold."""
    store, scale = scope.recorded_pushes(), scope.scale
    own_folds, own, every = [], [], []
    engine_errors: dict[str, Step[EndOffsets]] = {}
    for surface, rows in surfaces_of(store).items():
        for fold in make_folds(store, FOLDS[scale], rows):
            tuned = TunedModels(fold.training, scale)
            models = (*tuned.physics(), *map(tuned.model, VARIANTS))
            own_folds.append(fold)
            own.append(Evaluate(tuple(models), Given(fold.tests)))
        pushes = store.take(rows)
        for engine, model in zip(
            ("", ", identified"), TunedModels(pushes, scale).physics(), strict=True
        ):
            engine_errors[f"{surface}{engine}"] = EndErrors(model, Given(pushes))
    folds = make_folds(store, FOLDS[scale])
    for fold in folds:
        tuned = TunedModels(fold.training, scale)
        models = [tuned.model(variant, "for-all") for variant in FOR_ALL]
        every.append(Evaluate(tuple(models), Given(fold.tests)))
    whole = BySurface(
        JoinFolds(tuple(own), tuple(own_folds)),
        JoinFolds(tuple(every), tuple(folds)),
        Given(store),
    )
    joined = Join((whole, *_elsewhere(scope, store)))
    return Plan(joined, engine_errors=engine_errors)


def _elsewhere(scope: Scope, store: Store) -> Iterator[Evaluate]:
    """Yield models of one surface on another: trained without its pushes, with few.

    Both are tested on the same pushes, on which neither was trained.
    """
    surfaces = surfaces_of(store)
    if not {_FROM, _TO} <= surfaces.keys():
        return
    few, tests = _few(store, surfaces[_TO])
    for count, rows in ((0, surfaces[_FROM]), (FEW, np.append(surfaces[_FROM], few))):
        tuned = TunedModels(store.take(rows), scope.scale)
        models = (*tuned.physics(), *map(tuned.model, ELSEWHERE))
        label = f"{_FROM} to {_TO}, {count} of it"
        condition = Condition(
            label=label,
            factors={"surface": _TO, "trained_on": _FROM, "training_pushes": count},
        )
        yield Evaluate(models, Given(store.take(tests)), condition)


def _few(store: Store, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return few of some pushes, and those that are no repeats of them."""
    repeats = store.repeats()[rows]
    order = np.argsort(fold_of_push(repeats, len(rows)), kind="stable")
    few = order[: min(FEW, len(rows) // 2)]
    seen = np.isin(repeats, repeats[few])
    return rows[few], rows[~seen]


STUDY = Study(
    question="On recorded pushes, is identifying the engine enough, or does learning "
    "lower the errors further?",
    plan=_plan,
    claims=(
        Claim(
            "an additive network around the identified engine errs less than it alone",
            errs_less(
                SUBJECT,
                "physics-identified",
                condition=_EVERYWHERE,
                metrics=("final_pos_mm", "final_rot_deg"),
            ),
        ),
    ),
    needs=(RECORDED,),
    subject=SUBJECT,
)
