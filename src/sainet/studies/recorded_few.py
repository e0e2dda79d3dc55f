"""Few recorded pushes: what do models learn from 25 to 200 of a surface?

Folds by kind of push; everything is fitted inside them, to the first pushes of each.
The smaller sets are parts of the larger ones.
"""

from collections.abc import Iterator
from dataclasses import replace
from itertools import product

import numpy as np

from sainet.datasets.splits import Fold, fold_of_push, make_folds
from sainet.datasets.store import Store
from sainet.evaluation.claims import Claim, errs_less
from sainet.evaluation.margins import errs_at_most_more
from sainet.report.figures.curves import draw_data_efficiency
from sainet.studies.candidates import ADDITIVE, NetworkCandidate, ProcessCandidate
from sainet.studies.cross_validation import PHYSICS_IDENTIFIED, fitted_and_tested
from sainet.studies.data_efficiency import of_pushes
from sainet.studies.recorded_models import Variant, surfaces_of
from sainet.studies.recorded_pushes import FOLDS, JoinFolds
from sainet.studies.steps import Join
from sainet.studies.study import RECORDED, Plan, Scope, Study

COUNTS = {"quick": (10,), "paper": (25, 50, 100, 200)}
PROCESSES = (ProcessCandidate("side"), ProcessCandidate("place"))
NETWORKS = tuple(
    NetworkCandidate(each)
    for each in (Variant("in", "tuned"), Variant("sain", "tuned"), ADDITIVE)
)
_HUNDRED = 100


def _plan(scope: Scope) -> Plan:
    """Return models of ever more pushes, beside the engine identified on them."""
    store, sizes = scope.recorded_pushes(), []
    networks = (replace(each, scale=scope.scale) for each in NETWORKS)
    models = (*networks, *PROCESSES)
    for pushes in COUNTS[scope.scale]:
        folds, parts, condition = [], [], of_pushes(pushes)
        for rows in surfaces_of(store).values():
            for fold in make_folds(store, FOLDS[scope.scale], rows):
                training = first_pushes(fold, pushes)
                folds.append(fold)
                parts.append(fitted_and_tested(training, fold.tests, condition, models))
        sizes.append(JoinFolds(tuple(parts), tuple(folds), condition))
    return Plan(Join(tuple(sizes)))


def first_pushes(fold: Fold, pushes: int) -> Store:
    """Return so many training pushes of a fold, repeats beside each other."""
    repeats = fold.training.repeats()
    kinds = fold_of_push(repeats, len(np.unique(repeats)), seed=fold.number)
    chosen = np.argsort(kinds, kind="stable")[:pushes]
    return fold.training.take(chosen)


_MARGIN = 0.05  # largest upper bound, as a fraction of the engine's error


def _claims() -> Iterator[Claim]:
    """Yield claims about processes beside the engine identified on the same pushes."""
    identified, ends = PHYSICS_IDENTIFIED.slug, ("final_pos_mm", "final_rot_deg")
    for each in PROCESSES:
        yield Claim(
            f"with {_HUNDRED} pushes a Gaussian process ({each.features}) errs less in "
            "rotation than the engine identified on them",
            errs_less(
                each.identity.slug,
                identified,
                condition=of_pushes(_HUNDRED).label,
                metrics=ends[1:],
            ),
        )
    for each, pushes in product((NETWORKS[-1], *PROCESSES), COUNTS["paper"]):
        yield Claim(
            f"with {pushes} pushes {each.identity.label} errs at most {_MARGIN:.0%} "
            "more than the engine identified on them",
            errs_at_most_more(
                each.identity.slug,
                identified,
                _MARGIN,
                condition=of_pushes(pushes).label,
                metrics=ends,
            ),
            margin=_MARGIN,
        )


STUDY = Study(
    question="How many recorded pushes of a surface does a model need to predict "
    "better than the engine that is identified on the same pushes?",
    plan=_plan,
    needs=(RECORDED,),
    subject=PHYSICS_IDENTIFIED.slug,
    claims=tuple(_claims()),
    figure=draw_data_efficiency,
)
