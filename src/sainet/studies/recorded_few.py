"""Few recorded pushes: does a Gaussian process learn from 25 to 200 of a surface?

Folds by kind of push; everything is fitted inside them, to the first pushes of each.
The smaller sets are parts of the larger ones.
"""

from sainet.datasets.splits import make_folds
from sainet.evaluation.claims import Claim, errs_less
from sainet.studies.cross_validation import (
    PHYSICS_IDENTIFIED,
    ProcessCandidate,
    fitted_and_tested,
)
from sainet.studies.data_efficiency import first_pushes, of_pushes
from sainet.studies.recorded_models import surfaces_of
from sainet.studies.recorded_pushes import FOLDS, JoinFolds
from sainet.studies.steps import Join
from sainet.studies.study import RECORDED, Plan, Scope, Study

COUNTS = {"quick": (10,), "paper": (25, 50, 100, 200)}
PROCESSES = (ProcessCandidate("side"), ProcessCandidate("place"))
_HUNDRED = 100


def _plan(scope: Scope) -> Plan:
    """Return processes of ever more pushes, each around the engine of its pushes."""
    store, sizes = scope.recorded_pushes(), []
    for pushes in COUNTS[scope.scale]:
        folds, parts, condition = [], [], of_pushes(pushes)
        for rows in surfaces_of(store).values():
            for fold in make_folds(store, FOLDS[scope.scale], rows):
                training = first_pushes(fold, pushes)
                folds.append(fold)
                parts.append(
                    fitted_and_tested(training, fold.tests, condition, PROCESSES)
                )
        sizes.append(JoinFolds(tuple(parts), tuple(folds), condition))
    return Plan(Join(tuple(sizes)))


STUDY = Study(
    question="From how few recorded pushes of a surface does a Gaussian process learn "
    "more than the identified engine?",
    plan=_plan,
    needs=(RECORDED,),
    subject=PHYSICS_IDENTIFIED.slug,
    claims=tuple(
        Claim(
            f"with {_HUNDRED} pushes a Gaussian process ({each.features}) errs less in "
            "rotation than the engine identified on them",
            errs_less(
                each.identity.slug,
                PHYSICS_IDENTIFIED.slug,
                condition=of_pushes(_HUNDRED).label,
                metrics=("final_rot_deg",),
            ),
        )
        for each in PROCESSES
    ),
)
