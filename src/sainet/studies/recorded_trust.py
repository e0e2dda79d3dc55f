"""Gaussian processes on recorded pushes: how well they predict, and how sure they are.

Each push is predicted by models that were fitted to others, of the same surface. Folds
by kind of push (surface, contact point, direction) leave out pushes whose places on the
table others may share; blocked folds leave out a fifth of the table, of the directions,
of the sides of the disk or of the time of recording.
"""

from collections.abc import Iterator
from itertools import permutations

from sainet.datasets.folds import BLOCKED
from sainet.datasets.store import Store
from sainet.evaluation.claims import Claim, errs_less
from sainet.evaluation.measurements import Condition
from sainet.learning.process_ends import ADDED
from sainet.studies.cross_validation import (
    PHYSICS_IDENTIFIED,
    EvaluateFitted,
    ProcessCandidate,
    WithUnions,
    cross_validated,
    fitted_and_tested,
)
from sainet.studies.study import RECORDED, Plan, Scope, Study

FOLDS = {"quick": 2, "paper": 5}
PROCESSES = tuple(ProcessCandidate(features) for features in ADDED)


def _plan(scope: Scope) -> Plan:
    """Return processes that are fitted to each fold, and on each surface for others."""
    store, is_whole = scope.recorded_pushes(), scope.scale == "paper"
    schemes = ("kind", *BLOCKED) if is_whole else ("kind",)
    count = FOLDS[scope.scale]
    parts, unions = cross_validated(store, schemes, count, PROCESSES)
    if is_whole:
        parts += _elsewhere(store)
    return Plan(WithUnions(tuple(parts), tuple(unions)))


def _elsewhere(store: Store) -> Iterator[EvaluateFitted]:
    """Yield models of one group of pushes on another: surfaces, and speeds."""
    groups = {name: store.of_group(name) for name in store.info.groups}
    for (trained, training), (tested, tests) in permutations(groups.items(), 2):
        label = f"{trained} to {tested}"
        condition = Condition(label=label, factors={"trained_on": trained})
        yield fitted_and_tested(training, tests, condition, PROCESSES)


STUDY = Study(
    question="On recorded pushes, does a Gaussian process around the identified engine "
    "err less than the engine, and does it know how sure it is?",
    plan=_plan,
    subject=PHYSICS_IDENTIFIED.slug,
    claims=tuple(
        Claim(
            f"a Gaussian process ({each.features}) around the identified engine errs "
            f"less than it alone, folds by {scheme}",
            errs_less(
                each.identity.slug,
                "physics-identified",
                condition=scheme,
                metrics=("final_pos_mm", "final_rot_deg"),
            ),
        )
        for scheme in (*BLOCKED, "kind")
        for each in PROCESSES
        if each.features != "angle"
    ),
    needs=(RECORDED,),
)
