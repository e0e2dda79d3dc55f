"""Control among more disks: longer rows; another target disk, and obstacles.

Bullet with noise is the world, and the tree search plans. All models face the same
goals, tables and noise.
"""

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
BLOCKED = "2 disks and 2 obstacles, hard"


def _rows(scope: Scope) -> Plan:
    """Return the trials of rows; with three disks a quarter of those with two."""
    count, pushes = TRIALS[scope.scale]
    two = ControlConfig(world="bullet", planner="tree", trials=count, pushes=pushes)
    three = replace(two, disks=3, trials=max(count // 4, 1))
    hard = replace(two, goals="hard")
    trials = _trials(EASY, two), _trials(HARD, hard), _trials(THREE, three)
    return Plan(Join(trials))


def _in_the_way(scope: Scope) -> Plan:
    """Return the trials with disks in the way: a quarter of those of two disks."""
    count, pushes = TRIALS[scope.scale]
    few = ControlConfig(
        world="bullet", planner="tree", trials=max(count // 4, 1), pushes=pushes
    )
    second = replace(few, disks=3, moved=2)
    blocked = replace(few, disks=4, obstacles=2, goals="hard")
    return Plan(Join((_trials(SECOND, second), _trials(BLOCKED, blocked))))


def _trials(label: str, config: ControlConfig) -> RunTrials:
    factors = {name: getattr(config, name) for name in _FACTORS}
    factors["target"] = config.target + 1
    return RunTrials(MODELS, config, Condition(label=label, factors=factors))


_ANY = SAIN_ANY.slug
# Declared before any of these trials, with twice as many goals of three disks, which
# were measured before with another cost and without `sain-any`.
STUDY = Study(
    question="Which model pushes rows of more disks to goals?",
    plan=_rows,
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
IN_THE_WAY = Study(
    question="Which model pushes disks to goals where other disks are in the way?",
    plan=_in_the_way,
    claims=(
        Claim(
            "with a disk in the way sain-any solves more easy goals than SAIN",
            solves_more(_ANY, SAIN.slug, SECOND),
        ),
    ),
)
