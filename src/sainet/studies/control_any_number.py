"""Control with more disks: longer rows; another target disk, and obstacles.

Bullet with noise is the world, and the tree search plans. All models face the same
goals, tables and noise. SAIN solves few goals of rows and uses all its pushes on the
others, so it pushes none of the longest rows.
"""

from dataclasses import replace

from sainet.control.config import ControlConfig
from sainet.evaluation.claims import Claim, solves_more
from sainet.evaluation.measurements import Condition
from sainet.models.model import Model
from sainet.studies.lab_control import solves_share
from sainet.studies.paper_setup import SAIN, physics
from sainet.studies.pretrained import SAIN_ANY
from sainet.studies.simulated_control import RunTrials
from sainet.studies.steps import Join, Load, Step
from sainet.studies.study import Plan, Scope, Study

TRIALS = {"quick": (1, 2), "paper": (100, 60)}  # and the most pushes of each
_ANY = Load(SAIN_ANY, "sain-any")
MODELS = (*physics(), Load(SAIN, "sain"), _ANY)
LONG = (4, 5)  # disks of the longest rows
IN_LONG_ROWS = (*physics(), _ANY)
_FACTORS = ("goals", "disks", "obstacles")
HARD, SECOND = "2 disks, hard", "second of 3 disks, easy"
BLOCKED = "2 disks and 2 obstacles, hard"


def easy(disks: int) -> str:
    """Return the label of trials of a row to easy goals."""
    return f"{disks} disks, easy"


def _rows(scope: Scope) -> Plan:
    """Return the trials of rows; more than two disks have half as many goals."""
    count, pushes = TRIALS[scope.scale]
    two = ControlConfig(world="bullet", planner="tree", trials=count, pushes=pushes)
    few, hard = replace(two, trials=max(count // 2, 1)), replace(two, goals="hard")
    three = _trials(easy(3), replace(few, disks=3))
    parts = [_trials(easy(2), two), _trials(HARD, hard), three]
    for disks in LONG if scope.scale == "paper" else ():
        usual = replace(few, disks=disks)
        adapted = replace(usual, adapt=True)
        parts += [_trials(easy(disks), usual, IN_LONG_ROWS)]
        parts += [_trials(f"{easy(disks)}, adapted", adapted, physics()[:1])]
    return Plan(Join(tuple(parts)))


def _in_the_way(scope: Scope) -> Plan:
    """Return the trials with disks in the way: a quarter of those of two disks."""
    count, pushes = TRIALS[scope.scale]
    few = ControlConfig(
        world="bullet", planner="tree", trials=max(count // 4, 1), pushes=pushes
    )
    second = _trials(SECOND, replace(few, disks=3, moved=2))
    blocked = replace(few, disks=4, obstacles=2, goals="hard")
    return Plan(Join((second, _trials(BLOCKED, blocked))))


def _trials(
    label: str, config: ControlConfig, models: tuple[Step[Model], ...] = MODELS
) -> RunTrials:
    factors = {name: getattr(config, name) for name in _FACTORS}
    factors["target"] = config.target + 1
    return RunTrials(models, config, Condition(label=label, factors=factors))


# Declared before rows were steered. No claim concerns the adapted trials, which were
# added when the results of the others were known.
STUDY = Study(
    question="Which model pushes rows of three and more disks to goals, and how long "
    "may a row be?",
    plan=_rows,
    claims=(
        Claim(
            "with three disks sain-any solves more easy goals than SAIN",
            solves_more(SAIN_ANY.slug, SAIN.slug, easy(3)),
        ),
        *(
            Claim(
                f"with {disks} disks sain-any solves at least 90 % of easy goals",
                solves_share(SAIN_ANY.slug, 0.9, easy(disks)),
            )
            for disks in (3, *LONG)
        ),
        Claim(
            "with two disks sain-any solves every hard goal",
            solves_share(SAIN_ANY.slug, 1.0, HARD),
        ),
    ),
)
IN_THE_WAY = Study(
    question="Which model pushes disks to goals where other disks are in the way?",
    plan=_in_the_way,
    claims=(
        Claim(
            "with a disk in the way sain-any solves more easy goals than SAIN",
            solves_more(SAIN_ANY.slug, SAIN.slug, SECOND),
        ),
    ),
)
