"""Gaussian processes on recorded pushes: how well they predict, and how sure they are.

Each push is predicted by models that were fitted to others, of the same surface. Folds
by kind of push (surface, contact point, direction) leave out pushes whose places on the
table others may share; blocked folds leave out a fifth of the table, of the directions,
of the sides of the disk or of the time of recording.
"""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from itertools import permutations
from pathlib import Path

import jax
import numpy as np
from jaxtyping import Float, Int
from msgspec import structs

from sainet.datasets.splits import fold_of_push, folds_of
from sainet.datasets.store import Store
from sainet.evaluation.claims import Claim, errs_less
from sainet.evaluation.evaluate import evaluate
from sainet.evaluation.joining import join
from sainet.evaluation.measurements import (
    Condition,
    Measurements,
    read_measurements,
)
from sainet.identification.identify import identify_into
from sainet.learning.process import fit_process
from sainet.learning.process_ends import ADDED
from sainet.models.identity import ModelId, ProcessFeatures
from sainet.models.library import load_model
from sainet.models.model import Model
from sainet.models.process_card import ProcessSettings
from sainet.studies import Scale
from sainet.studies.recorded_models import IDENTIFIED, surfaces_of
from sainet.studies.recorded_pushes import JoinFolds
from sainet.studies.runner import Runner
from sainet.studies.steps import Apart, Given, Step
from sainet.studies.study import MEASUREMENTS, RECORDED, Plan, Scope, Study

FOLDS = {"quick": 2, "paper": 5}
FEATURES: tuple[ProcessFeatures, ...] = (*ADDED,)
PROCESSES = {
    each: ModelId(kind="gp", simulator=IDENTIFIED, features=each) for each in FEATURES
}
_PHYSICS = ModelId(kind="physics", simulator=IDENTIFIED)
_ENGINE = "engine"


class FitAll(Apart[tuple[Model, ...]]):
    """The engine identified on some pushes, and every process around it."""

    pushes: Given

    def work(self, folder: Path) -> None:
        """Identify the engine, then fit the processes."""
        engine = identify_into(self.pushes.store, folder / _ENGINE).engine
        for features in FEATURES:
            settings = ProcessSettings(features=features)
            fit_process(self.pushes.store, folder / features, engine, settings)

    def run(self, runner: Runner) -> tuple[Model, ...]:
        """Return identified physics and the processes."""
        folder = runner.folder(self)
        self.work(folder)  # returns at once where it is finished
        return self.models_in(folder)

    def models_in(self, folder: Path) -> tuple[Model, ...]:
        """Return identified physics and the processes of a finished folder."""
        engine = replace(load_model(str(folder / _ENGINE)), id=_PHYSICS)
        fitted = (
            replace(load_model(str(folder / features)), id=identity)
            for features, identity in PROCESSES.items()
        )
        return engine, *fitted


class EvaluateFitted(Apart[Measurements]):
    """Errors and regions of all models on pushes that they were not fitted to."""

    models: FitAll
    pushes: Given
    condition: Condition

    def work(self, folder: Path) -> None:
        """Predict the pushes, and write the measurements."""
        if (folder / MEASUREMENTS).is_file():
            return
        fitted = self.models.models_in(folder.parent / self.models.folder_name)
        found = evaluate((load_model("physics"), *fitted), self.pushes.store)
        folder.mkdir(parents=True, exist_ok=True)
        found.write(folder / MEASUREMENTS)
        # Each fold compiles programs of its own; hundreds of them crash XLA.
        jax.clear_caches()

    def run(self, runner: Runner) -> Measurements:
        """Return the errors."""
        folder = runner.folder(self)
        self.work(folder)
        return read_measurements(folder / MEASUREMENTS).in_condition(self.condition)


class WithUnions(Step[Measurements]):
    """Measurements of all conditions, and of some of them together."""

    parts: tuple[Step[Measurements], ...]
    unions: tuple[Condition, ...]

    def run(self, runner: Runner) -> Measurements:
        """Return the measurements of all parts."""
        whole = join([runner.result(part) for part in self.parts])
        conditions = whole.header.conditions + self.unions
        header = structs.replace(whole.header, conditions=conditions)
        return replace(whole, header=header)


def blocks(values: Float[np.ndarray, " push"], count: int) -> Int[np.ndarray, " push"]:
    """Return the fold of each push: neighbouring values share one, sizes are equal."""
    order = np.argsort(np.argsort(values, kind="stable"), kind="stable")
    return order * count // len(values)


def schemes(
    whole: Store, rows: Int[np.ndarray, " push"], scale: Scale
) -> Mapping[str, Int[np.ndarray, " push"]]:
    """Return the fold of each push of one surface, by the name of the scheme.

    Args:
        whole: the pushes on all surfaces; folds by kind are those of other studies.
        rows: of one surface.
        scale: of the study.
    """
    count, store = FOLDS[scale], whole.take(rows)
    names = ("initial", "initial_pusher", "command_position", "steps")
    arrays = store.read(slice(None), names)
    place, start = arrays["initial"][:, 0, :3], arrays["initial_pusher"]
    last = arrays["command_position"][np.arange(len(start)), arrays["steps"] - 1]
    ahead, normal = last - start, place[:, :2] - start
    side = np.arctan2(normal[:, 1], normal[:, 0]) - place[:, 2]
    found = {"kind": fold_of_push(whole.repeats(), count)[rows]}
    if scale == "quick":
        return found
    return found | {
        "place": blocks(place[:, :2] @ _longest_axis(place[:, :2]), count),
        "direction": blocks(np.arctan2(ahead[:, 1], ahead[:, 0]), count),
        "side": blocks(np.mod(side, 2 * np.pi), count),
        "order": blocks(np.arange(len(start), dtype=float), count),
    }


def _longest_axis(places: Float[np.ndarray, "push 2"]) -> Float[np.ndarray, "2"]:
    """Return the direction in which places are spread most."""
    return np.linalg.svd(places - places.mean(axis=0), full_matrices=False)[2][0]


def _plan(scope: Scope) -> Plan:
    """Return processes that are fitted to each fold, and on each surface for others."""
    store = scope.recorded_pushes()
    parts: list[Step[Measurements]] = []
    unions: dict[str, list[str]] = {}
    for surface, rows in surfaces_of(store).items():
        for scheme, owner in schemes(store, rows, scope.scale).items():
            label = f"{scheme}, {surface}"
            unions.setdefault(scheme, []).append(label)
            factors: dict[str, float | str] = {"folds": scheme, "surface": surface}
            condition = Condition(label=label, factors=factors)
            folds = tuple(folds_of(store, rows, owner, FOLDS[scope.scale]))
            tests = (_test(f.training, f.tests, condition) for f in folds)
            parts.append(JoinFolds(tuple(tests), folds, condition))
    if scope.scale == "paper":
        parts += _elsewhere(store)
    joined = (Condition(label=k, parts=tuple(v)) for k, v in unions.items())
    return Plan(WithUnions(tuple(parts), tuple(joined)))


def _test(training: Store, tests: Store, condition: Condition) -> EvaluateFitted:
    return EvaluateFitted(FitAll(Given(training)), Given(tests), condition)


def _elsewhere(store: Store) -> Iterator[EvaluateFitted]:
    """Yield models of one group of pushes on another: surfaces, and speeds."""
    groups = {name: store.of_group(name) for name in store.info.groups}
    for (trained, training), (tested, tests) in permutations(groups.items(), 2):
        label = f"{trained} to {tested}"
        condition = Condition(label=label, factors={"trained_on": trained})
        yield _test(training, tests, condition)


STUDY = Study(
    question="On recorded pushes, does a Gaussian process around the identified engine "
    "err less than the engine, and does it know how sure it is?",
    plan=_plan,
    subject=_PHYSICS.slug,
    claims=tuple(
        Claim(
            f"a Gaussian process ({each.features}) around the identified engine errs "
            f"less than it alone, folds by {scheme}",
            errs_less(
                each.slug,
                "physics-identified",
                condition=scheme,
                metrics=("final_pos_mm", "final_rot_deg"),
            ),
        )
        for scheme in ("place", "direction", "side", "order", "kind")
        for each in (PROCESSES["side"], PROCESSES["place"])
    ),
    needs=(RECORDED,),
)
