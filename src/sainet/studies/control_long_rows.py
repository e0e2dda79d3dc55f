"""Control of longer rows of disks, without the paper's network.

Bullet with noise is the world, and the tree search plans. With three disks there are
more goals than in `control_any_number`: the paper's network, which solves few and uses
all its pushes on the others, is left out.
"""

from dataclasses import replace

from sainet.control.config import ControlConfig
from sainet.evaluation.claims import Claim
from sainet.evaluation.measurements import Condition
from sainet.studies.control_any_number import TRIALS
from sainet.studies.lab_control import solves_share
from sainet.studies.paper_setup import physics
from sainet.studies.pretrained import SAIN_ANY
from sainet.studies.simulated_control import RunTrials
from sainet.studies.steps import Join, Load
from sainet.studies.study import Plan, Scope, Study

GOALS = 50  # of each number of disks, at the scale paper
DISKS = (3, 4, 5)
MODELS = (physics()[1], Load(SAIN_ANY, "sain-any"))
_LABEL = "{} disks, easy"


def _plan(scope: Scope) -> Plan:
    """Return the trials of three to five disks; at the quick scale of three."""
    most, pushes = TRIALS[scope.scale]
    usual = ControlConfig(world="bullet", planner="tree", pushes=pushes)
    trials = (
        RunTrials(
            MODELS,
            replace(usual, disks=disks, trials=min(GOALS, most)),
            Condition(label=_LABEL.format(disks), factors={"disks": disks}),
        )
        for disks in (DISKS if scope.scale == "paper" else DISKS[:1])
    )
    return Plan(Join(tuple(trials)))


STUDY = Study(
    question="How long may a row of disks be that is pushed to a goal?",
    plan=_plan,
    claims=tuple(
        Claim(
            f"with {disks} disks sain-any solves at least 90 % of easy goals",
            solves_share(SAIN_ANY.slug, 0.9, _LABEL.format(disks)),
        )
        for disks in DISKS
    ),
)
