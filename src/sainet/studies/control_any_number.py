"""Control among more disks: longer rows, another target disk, and obstacles.

Bullet with noise is the world, and the tree search plans. All models face the same
goals, tables and noise.
"""

from collections.abc import Iterator
from dataclasses import replace

from sainet.control.config import ControlConfig
from sainet.evaluation.claims import Claim, solves_more
from sainet.evaluation.measurements import Condition
from sainet.studies.lab_control import solves_share
from sainet.studies.paper_setup import SAIN, physics
from sainet.studies.pretrained import SAIN_ANY
from sainet.studies.simulated_control import RunTrials
from sainet.studies.steps import Join, Load
from sainet.studies.study import Plan, Scope, Study

TRIALS = {"quick": (1, 2), "paper": (100, 60)}  # and the most pushes of each
MODELS = (*physics(), Load(SAIN, "sain"), Load(SAIN_ANY, "sain-any"))
_FACTORS = ("goals", "disks", "obstacles")
EASY, HARD = "2 disks, easy", "2 disks, hard"
THREE, SECOND = "3 disks, easy", "second of 3 disks, easy"
OBSTACLES = "2 disks and 2 obstacles, hard"


def _plan(scope: Scope) -> Plan:
    """Return the trials.

    With three disks there are half as many as with two; with another target disk and
    with obstacles an eighth.
    """
    return Plan(Join(tuple(_trials(*TRIALS[scope.scale]))))


def _trials(count: int, pushes: int) -> Iterator[RunTrials]:
    two = ControlConfig(world="bullet", planner="tree", trials=count, pushes=pushes)
    three = replace(two, disks=3, trials=max(count // 2, 1))
    few = replace(three, trials=max(count // 8, 1))
    for label, config in (
        (EASY, two),
        (HARD, replace(two, goals="hard")),
        (THREE, three),
        (SECOND, replace(few, moved=2)),
        (OBSTACLES, replace(few, disks=4, obstacles=2, goals="hard")),
    ):
        factors = {name: getattr(config, name) for name in _FACTORS}
        factors["target"] = config.target + 1
        yield RunTrials(MODELS, config, Condition(label=label, factors=factors))


_ANY = SAIN_ANY.slug
# Declared before any of these trials; those of three disks were measured before with
# another cost and without `sain-any`.
STUDY = Study(
    question="Which model pushes rows of more disks to goals, and past obstacles?",
    plan=_plan,
    claims=(
        Claim(
            "with three disks sain-any solves more easy goals than SAIN",
            solves_more(_ANY, SAIN.slug, THREE),
        ),
        Claim(
            "with three disks sain-any solves at least 90 % of easy goals",
            solves_share(_ANY, 0.9, THREE),
        ),
        Claim(
            "with two disks sain-any solves every hard goal",
            solves_share(_ANY, 1.0, HARD),
        ),
    ),
)
