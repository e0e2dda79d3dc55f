"""Control with Gaussian processes of few pushes: does weighing uncertainty help?

The tree search or the paper's search judges pushes by the predicted state, or by the
mean cost over where the process expects the disks. Bullet is the world and the truth of
the training pushes, and the process corrects the engine with assumed properties, or
with given ones that are wrong. In a virtual lab, the pushes are those that its robot
recorded, and the process corrects the engine that was identified on them.
"""

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

from sainet.control.config import CollectConfig, ControlConfig
from sainet.control.worlds import in_world, world_of
from sainet.datasets.config import GenerateConfig
from sainet.engines.simulator import SIMULATORS, SimulatorSpec
from sainet.evaluation.measurements import Condition
from sainet.learning.process import fit_process
from sainet.models.identity import ModelId
from sainet.models.library import find_internal_engine, load_model
from sainet.models.model import Model
from sainet.models.process_card import ProcessSettings
from sainet.studies.lab_pushes import MUJOCO, Collect
from sainet.studies.recorded_models import IDENTIFIED
from sainet.studies.runner import Runner
from sainet.studies.simulated_control import RunTrials
from sainet.studies.steps import Apart, First, Identify, Join, Simulate
from sainet.studies.study import BULLET, Plan, Scope, Study

TRIALS = {"quick": (1, 2), "paper": (50, 60)}  # and the most pushes of each
PUSHES = {"quick": (20,), "paper": (50, 300)}
WRONG = {"quick": (0.1,), "paper": (0.05, 0.1)}  # fraction of each mass and radius
_SETTINGS = ProcessSettings(features="angle")
_SEED = 5


class FitProcess(Apart[Model]):
    """A Gaussian process of pushes, around an engine."""

    is_kept = True

    pushes: First
    simulator: SimulatorSpec
    identified: Identify | None = None  # the engine, instead

    @property
    def id(self) -> ModelId:
        """The identity of the process."""
        return ModelId(kind="gp", simulator=self.simulator, features=_SETTINGS.features)

    @property
    def name(self) -> str:
        """The model and the number of pushes."""
        return f"{self.id.slug}-{self.pushes.count}"

    def run(self, runner: Runner) -> Model:
        """Return the process, fitted where that is unfinished."""
        folder, pushes = runner.folder(self), runner.result(self.pushes)
        found = self.identified
        engine = self.simulator.slug if found is None else str(runner.folder(found))
        fit_process(pushes, folder, find_internal_engine(engine), _SETTINGS)
        return replace(load_model(str(folder)), id=self.id)


class _Case(NamedTuple):
    """Trials with one process, without and with the expected cost."""

    label: str
    process: FitProcess
    config: ControlConfig

    def trials(self) -> Iterator[RunTrials]:
        """Yield the trials of both ways to judge pushes."""
        for is_expected in (False, True):
            config = replace(self.config, expected_cost=is_expected)
            factors: dict[str, float | str] = {
                "training_pushes": self.process.pushes.count,
                "planner": config.planner,
                "property_error": config.property_error,
                "world": world_of(config),
            }
            label = self.label + ", expected cost" * is_expected
            condition = Condition(label=label, factors=factors)
            yield RunTrials((self.process,), config, condition)


def _plan(scope: Scope) -> Plan:
    """Return trials in all cases, without and with the expected cost."""
    return Plan(Join(tuple(each for case in _cases(scope) for each in case.trials())))


def _cases(scope: Scope) -> Iterator[_Case]:
    counts, (trials, most) = PUSHES[scope.scale], TRIALS[scope.scale]
    config = GenerateConfig(
        pushes=max(counts), setup="robot", engine="bullet", seed=_SEED
    )
    simulated = Simulate("bullet-few", config)
    usual = ControlConfig(
        world="bullet", goals="hard", planner="tree", trials=trials, pushes=most
    )
    for count in counts:
        process = FitProcess(First(simulated, count), SIMULATORS["planar"])
        yield _Case(f"{count} pushes", process, usual)
    few = First(simulated, min(counts))
    given = FitProcess(few, SIMULATORS["planar"])
    label = f"{few.count} pushes, greedy"
    yield _Case(label, given, replace(usual, planner="greedy"))
    given = FitProcess(few, SIMULATORS["planar-true"])
    for wrong in WRONG[scope.scale]:
        label = f"{few.count} pushes, wrong by {wrong:.0%}"
        yield _Case(label, given, replace(usual, property_error=wrong))
    session = Collect(CollectConfig(robot="lab", pushes=2 * few.count))
    recorded = First(session, few.count)
    identified = Identify(ModelId(kind="physics", simulator=IDENTIFIED), recorded)
    process = FitProcess(recorded, IDENTIFIED, identified)
    label = f"{few.count} pushes of a virtual lab"
    yield _Case(label, process, in_world(usual, "lab"))


STUDY = Study(
    question="With few training pushes, does planning with expected costs solve more "
    "goals?",
    plan=_plan,
    needs=(BULLET, MUJOCO),
)
