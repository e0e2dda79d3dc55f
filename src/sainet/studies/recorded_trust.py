"""Gaussian processes on recorded pushes: how well they predict, and how sure they are.

Each push is predicted by models that were fitted to others, of the same surface. Folds
by kind of push (surface, contact point, direction) leave out pushes whose places on the
table others may share; blocked folds leave out a fifth of the table, of the directions,
of the sides of the disk or of the time of recording. On another surface all models also
abstain: the engine with assumed properties predicts there.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import permutations

import numpy as np
from msgspec import structs
from xarray import DataArray

from sainet.datasets.folds import BLOCKED
from sainet.datasets.groups import surface_of
from sainet.datasets.store import Store
from sainet.evaluation.abstention import keeps_to_engine
from sainet.evaluation.claims import Claim, errs_less
from sainet.evaluation.joining import add_models
from sainet.evaluation.measurements import Condition, Measurements
from sainet.evaluation.summary import BASELINE
from sainet.learning.process_ends import ADDED
from sainet.models.identity import ModelId
from sainet.studies.candidates import ChosenProcess, ProcessCandidate
from sainet.studies.cross_validation import (
    PHYSICS_IDENTIFIED,
    EvaluateFitted,
    WithUnions,
    fitted_and_tested,
    in_folds,
)
from sainet.studies.runner import Runner
from sainet.studies.steps import Step
from sainet.studies.study import RECORDED, Plan, Scope, Study

PROCESSES = tuple(ProcessCandidate(features) for features in ADDED)
CHOSEN = (ChosenProcess("side"), ChosenProcess("place"))
FITTED = (PHYSICS_IDENTIFIED, *(each.identity for each in PROCESSES))
MOST = 0.03  # share by which a model that abstains may err more than the engine


class WithAbstaining(Step[Measurements]):
    """Measurements, and rows of models that abstain on pushes of another surface.

    Within their surface these models predict as they do otherwise: there are no rows.
    """

    measured: Step[Measurements]
    models: tuple[ModelId, ...]
    elsewhere: tuple[str, ...]  # conditions: all pushes are of another surface

    def run(self, runner: Runner) -> Measurements:
        """Return the measurements with these rows."""
        return self.added_to(runner.result(self.measured))

    def added_to(self, measured: Measurements) -> Measurements:
        """Return measurements with these rows: the errors of the engine there."""
        engine, header = measured.of_models([BASELINE]).data, measured.header
        labels = np.array([condition.label for condition in header.conditions])
        is_other = np.isin(labels[engine["condition"].values], self.elsewhere)
        here = DataArray(is_other, dims="sample")
        rows = engine.assign({k: engine[k].where(here) for k in measured.error_names})
        for model in self.models:
            own = structs.replace(header, models=(model.abstaining,))
            measured = add_models(measured, Measurements(rows, own))
        return measured


def _plan(scope: Scope) -> Plan:
    """Return processes that are fitted to each fold, and on each surface for others."""
    within, store = _within(scope, PROCESSES), scope.recorded_pushes()
    if scope.scale != "paper":
        return Plan(within)
    measured = replace(within, parts=(*within.parts, *_elsewhere(store)))
    return Plan(WithAbstaining(measured, FITTED, _other_surfaces(store.info.groups)))


def _chosen(scope: Scope) -> Plan:
    """Return processes whose inputs and kernel are chosen in each fold."""
    return Plan(_within(scope, CHOSEN))


def _within(scope: Scope, models: Sequence[ProcessCandidate]) -> WithUnions:
    """Return the measurements of all divisions into folds."""
    return in_folds(scope, scope.recorded_pushes(), ("kind", *BLOCKED), models)


def _elsewhere(store: Store) -> Iterator[EvaluateFitted]:
    """Yield models of one group of pushes on another: surfaces, and speeds."""
    groups = {name: store.of_group(name) for name in store.info.groups}
    for (trained, training), (tested, tests) in permutations(groups.items(), 2):
        label = _label(trained, tested)
        condition = Condition(label=label, factors={"trained_on": trained})
        yield fitted_and_tested(training, tests, condition, PROCESSES)


def _other_surfaces(groups: Sequence[str]) -> tuple[str, ...]:
    """Return the labels of conditions whose pushes are of another surface."""
    return tuple(
        _label(*pair)
        for pair in permutations(groups, 2)
        if len({*map(surface_of, pair)}) > 1
    )


def _label(trained: str, tested: str) -> str:
    return f"{trained} to {tested}"


def _errs_less_than_the_engine(
    models: Sequence[ProcessCandidate], words: str
) -> tuple[Claim, ...]:
    return tuple(
        Claim(
            f"a Gaussian process ({each.features}{words}) around the identified engine "
            f"errs less than it alone, folds by {scheme}",
            errs_less(
                each.identity.slug,
                PHYSICS_IDENTIFIED.slug,
                condition=scheme,
                metrics=("final_pos_mm", "final_rot_deg"),
            ),
        )
        for scheme in (*BLOCKED, "kind")
        for each in models
        if each.features != "angle"
    )


STUDY = Study(
    question="On recorded pushes, does a Gaussian process around the identified engine "
    "err less than the engine, and are its regions calibrated?",
    plan=_plan,
    subject=PHYSICS_IDENTIFIED.slug,
    claims=_errs_less_than_the_engine(PROCESSES, "")
    + tuple(
        Claim(
            f"on the other surface {each.abstaining.slug} errs at most "
            f"{100 * MOST:.0f} % more than the engine with assumed properties",
            keeps_to_engine(each.abstaining.slug, BASELINE, share=MOST),
        )
        for each in FITTED
    ),
    needs=(RECORDED,),
)
CHOSEN_STUDY = Study(
    question="On recorded pushes, how well does a Gaussian process predict if its "
    "inputs and kernel are chosen without the test pushes?",
    plan=_chosen,
    subject=PHYSICS_IDENTIFIED.slug,
    claims=_errs_less_than_the_engine(CHOSEN, " at most, chosen in each fold"),
    needs=(RECORDED,),
)
