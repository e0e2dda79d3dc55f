"""Ensembles of networks on recorded pushes, beside one network and a Gaussian process.

All models are fitted around the engine identified on the same pushes. Blocked folds
leave out a fifth of the table; folds by kind of push share its places.
"""

from collections.abc import Iterator
from dataclasses import replace
from itertools import product

from sainet.evaluation.claims import Claim, errs_less
from sainet.studies import candidates
from sainet.studies.cross_validation import PHYSICS_IDENTIFIED, in_folds
from sainet.studies.study import RECORDED, Plan, Scope, Study

_VARIANTS = candidates.ADDITIVE, candidates.WITH_PLACE
_KINDS = candidates.NetworkCandidate, candidates.EnsembleCandidate
NETWORKS = tuple(kind(variant) for variant, kind in product(_VARIANTS, _KINDS))
PROCESS = candidates.CANDIDATES["gp-place"]
QUICK = 120  # pushes of each group: half of them suffice to calibrate an ensemble


def _plan(scope: Scope) -> Plan:
    """Return all models in all folds; at the quick scale the networks without place."""
    chosen = NETWORKS if scope.scale == "paper" else NETWORKS[:2]
    models = (*(replace(each, scale=scope.scale) for each in chosen), PROCESS)
    return Plan(
        in_folds(scope, scope.recorded_pushes(QUICK), ("kind", "place"), models)
    )


def _claims() -> Iterator[Claim]:
    """Yield what is compared, in the harder folds first."""
    one, several, one_place, several_place = (each.identity for each in NETWORKS)
    pairs = (
        *((model, PHYSICS_IDENTIFIED) for model in (several, several_place)),
        *((several, one), (several_place, one_place)),
        (PROCESS.identity, several_place),
    )
    for folds, (model, other) in product(("place", "kind"), pairs):
        ends = "final_pos_mm", "final_rot_deg"
        rule = errs_less(model.slug, other.slug, condition=folds, metrics=ends)
        text = f"{model.label} errs less than {other.label}, folds by {folds}"
        yield Claim(text, rule)


STUDY = Study(
    question="On recorded pushes, what do ensembles of networks add to one network, "
    "and are their regions calibrated?",
    plan=_plan,
    claims=tuple(_claims()),
    needs=(RECORDED,),
)
