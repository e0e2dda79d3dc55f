"""Feedforward networks on the whole state, compared with object-based networks.

A feedforward network takes only as many disks as it was trained on: one of two disks
cannot predict three, and three disks need networks of their own.
"""

from collections.abc import Sequence

from msgspec import structs

from sainet.datasets.config import GenerateConfig
from sainet.evaluation.claims import Claim, errs_less
from sainet.evaluation.measurements import Condition
from sainet.models.identity import ModelId
from sainet.studies.paper_setup import IN, SAIN_BULLET
from sainet.studies.reduced_setup import ReducedSetup
from sainet.studies.steps import Join
from sainet.studies.study import Plan, Scope, Study

OBJECTS = (IN, SAIN_BULLET)
OF_TWO = tuple(structs.replace(each, features="whole-state") for each in OBJECTS)
OF_THREE = tuple(structs.replace(each, variant="three-disks") for each in OF_TWO)


def _plan(scope: Scope) -> Plan:
    """Return the errors of both forms on two disks, and on three."""
    reduced, three = ReducedSetup(scope), GenerateConfig(disks=3)
    objects = reduced.train(*OBJECTS)
    pushes = reduced.training_pushes("3-disks", three)
    parts = (
        reduced.compare(
            objects + reduced.train(*OF_TWO), reduced.test_pushes(), _disks(2)
        ),
        reduced.compare(
            objects + reduced.train(*OF_THREE, pushes=pushes),
            reduced.test_pushes("3-disks", three),
            _disks(3),
        ),
    )
    return Plan(Join(parts))


def _disks(count: int) -> Condition:
    return Condition(label=f"{count} disks", factors={"disks": count})


def _less(text: str, models: tuple[ModelId, ModelId], disks: int) -> Claim:
    where = _disks(disks).label
    one, other = (model.slug for model in models)
    return Claim(f"{text}, {where}", errs_less(one, other, condition=where))


def _claims(
    rivals: Sequence[ModelId], disks: int, own: str = "", theirs: str = ""
) -> tuple[Claim, ...]:
    """Return that object-based networks of two disks err less than their rivals.

    Args:
        rivals: of each object-based network.
        disks: of the test pushes.
        own: training pushes of the object-based networks, in words.
        theirs: training pushes of the rivals, in words.
    """
    names = ("IN", "SAIN around Bullet"), ("without an engine", "around Bullet")
    pairs = zip(OBJECTS, rivals, strict=True)
    return tuple(
        _less(
            f"{name}{own} errs less than a feedforward network {kind}{theirs}",
            pair,
            disks,
        )
        for name, kind, pair in zip(*names, pairs, strict=True)
    )


STUDY = Study(
    question="Do object-based networks err less than a feedforward network on the "
    "whole state?",
    plan=_plan,
    claims=(
        *_claims(OF_TWO, 2),
        *_claims(OF_THREE, 3, " trained on two disks", " trained on three"),
        # Never testable: such a network takes two disks only.
        _less(
            "a feedforward network trained on two disks errs less than IN",
            (OF_TWO[0], IN),
            3,
        ),
    ),
)
