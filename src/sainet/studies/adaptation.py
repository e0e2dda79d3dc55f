"""Control with wrong properties: what adaptation during an episode wins back.

Bullet is the world, and the tree search plans. Every mass and radius given to a model
is too large or too small by a tenth; or the given properties are the nominal ones. In
the virtual labs, where no engine knows the frictions, the surface changes during the
episode, and the paper's search plans.
"""

from collections.abc import Iterator
from dataclasses import replace

from sainet.control.config import ControlConfig
from sainet.evaluation.measurements import Condition
from sainet.studies.lab_pushes import MUJOCO, WORLD, JoinLabs
from sainet.studies.paper_setup import physics
from sainet.studies.simulated_control import RunTrials
from sainet.studies.steps import Join, Load
from sainet.studies.study import Plan, Scope, Study

TRIALS = {"quick": (1, 2), "paper": (100, 60)}  # and the most pushes of each
# Labs, trials in each, the most pushes, and those before the surface changes.
LAB_TRIALS = {"quick": (2, 1, 3, 1), "paper": (5, 20, 60, 10)}
WRONG = 0.1  # fraction of each mass and radius
NOMINAL, TRUE = physics()
ON_ABS, THEN_PLYWOOD = "ABS", "ABS, then plywood"


def _plan(scope: Scope) -> Plan:
    """Return the trials of each kind of properties, without and with adaptation."""
    return Plan(Join(tuple(_trials(*TRIALS[scope.scale]))))


def _trials(count: int, pushes: int) -> Iterator[RunTrials]:
    usual = ControlConfig(
        world="bullet", goals="hard", planner="tree", trials=count, pushes=pushes
    )
    nominal = replace(usual, given_properties="assumed")
    for label, config, model in (
        ("true properties", usual, TRUE),
        (f"wrong by {WRONG:.0%}", replace(usual, property_error=WRONG), TRUE),
        ("nominal", nominal, NOMINAL),
    ):
        yield _condition(label, config, model)
        if config != usual:
            yield _condition(f"{label}, adapted", replace(config, adapt=True), model)


def _condition(
    label: str, config: ControlConfig, model: Load, **more: str
) -> RunTrials:
    factors: dict[str, float | str] = {
        "given_properties": config.given_properties,
        "property_error": config.property_error,
        "adapt": str(config.adapt).lower(),
        **more,
    }
    return RunTrials((model,), config, Condition(label=label, factors=factors))


def _new_surface(scope: Scope) -> Plan:
    """Return trials on ABS, and on ABS, then plywood, without and with adaptation."""
    labs, *sizes = LAB_TRIALS[scope.scale]
    parts = [(lab, trials) for lab in range(labs) for trials in _in_lab(lab, *sizes)]
    return Plan(
        JoinLabs(tuple(each for _, each in parts), tuple(lab for lab, _ in parts))
    )


def _in_lab(lab: int, count: int, pushes: int, before: int) -> Iterator[RunTrials]:
    usual = ControlConfig(
        robot="lab", lab=lab, seed=lab, goals="hard", trials=count, pushes=pushes
    )
    for label, after in ((ON_ABS, None), (THEN_PLYWOOD, before)):
        for adapt in (False, True):
            config = replace(usual, new_surface_after=after, adapt=adapt)
            yield _condition(label + ", adapted" * adapt, config, TRUE, world=WORLD)


STUDY = Study(
    question="With wrong masses and radii, how many more goals are solved if the model "
    "adapts during an episode?",
    plan=_plan,
)
NEW_SURFACE_STUDY = Study(
    question="Virtual lab: if the surface changes during an episode, does adaptation "
    "help?",
    plan=_new_surface,
    needs=(MUJOCO,),
)
