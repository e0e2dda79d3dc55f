"""Control with wrong properties: what adaptation during an episode wins back.

Bullet is the world, and the tree search plans. Every mass and radius given to a model
is too large or too small by a tenth; or the given properties are the nominal ones.
"""

from collections.abc import Iterator
from dataclasses import replace

from sainet.control.config import ControlConfig
from sainet.evaluation.measurements import Condition
from sainet.studies.paper_setup import physics
from sainet.studies.simulated_control import RunTrials
from sainet.studies.steps import Join, Load
from sainet.studies.study import Plan, Scope, Study

TRIALS = {"quick": (1, 2), "paper": (100, 60)}  # and the most pushes of each
WRONG = 0.1  # fraction of each mass and radius
NOMINAL, TRUE = physics()


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


def _condition(label: str, config: ControlConfig, model: Load) -> RunTrials:
    factors: dict[str, float | str] = {
        "given_properties": config.given_properties,
        "property_error": config.property_error,
        "adapt": str(config.adapt).lower(),
    }
    return RunTrials((model,), config, Condition(label=label, factors=factors))


STUDY = Study(
    question="With wrong masses and radii, what does adaptation during an episode win "
    "back?",
    plan=_plan,
)
