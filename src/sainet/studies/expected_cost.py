"""Control with Gaussian processes of few pushes: does weighing uncertainty help?

Bullet is the world and the truth of the training pushes. The process corrects the
engine with assumed properties; the tree search judges pushes by the predicted state, or
by the mean cost over where the process expects the disks.
"""

from collections.abc import Iterator
from dataclasses import replace

from sainet.control.config import ControlConfig
from sainet.datasets.config import GenerateConfig
from sainet.engines.simulator import SIMULATORS, InternalEngine
from sainet.evaluation.measurements import Condition
from sainet.learning.process import fit_process
from sainet.models.identity import ModelId
from sainet.models.library import load_model
from sainet.models.model import Model
from sainet.models.process_card import ProcessSettings
from sainet.studies.runner import Runner
from sainet.studies.simulated_control import RunTrials
from sainet.studies.steps import Apart, First, Join, Simulate
from sainet.studies.study import Plan, Scope, Study

TRIALS = {"quick": (1, 2), "paper": (50, 60)}  # and the most pushes of each
PUSHES = {"quick": (20,), "paper": (50, 300)}
_SIMULATOR, _SETTINGS = SIMULATORS["planar"], ProcessSettings(features="angle")
_PROCESS = ModelId(kind="gp", simulator=_SIMULATOR, features=_SETTINGS.features)
_SEED = 5


class FitProcess(Apart[Model]):
    """A Gaussian process of pushes, around the engine with assumed properties."""

    is_kept = True

    pushes: First

    @property
    def name(self) -> str:
        """The model and the number of pushes."""
        return f"{_PROCESS.slug}-{self.pushes.count}"

    def run(self, runner: Runner) -> Model:
        """Return the process, fitted where that is unfinished."""
        folder, pushes = runner.folder(self), runner.result(self.pushes)
        fit_process(pushes, folder, InternalEngine(_SIMULATOR), _SETTINGS)
        return replace(load_model(str(folder)), id=_PROCESS)


def _plan(scope: Scope) -> Plan:
    """Return trials with processes of few and of more pushes, without and with it."""
    return Plan(Join(tuple(_trials(scope))))


def _trials(scope: Scope) -> Iterator[RunTrials]:
    counts, (count, most) = PUSHES[scope.scale], TRIALS[scope.scale]
    config = GenerateConfig(
        pushes=max(counts), setup="robot", engine="bullet", seed=_SEED
    )
    pushes = Simulate("bullet-few", config)
    usual = ControlConfig(world="bullet", goals="hard", planner="tree", trials=count)
    for number in counts:
        fitted = FitProcess(First(pushes, number))
        for is_expected in (False, True):
            label = f"{number} pushes" + ", expected cost" * is_expected
            factors: dict[str, float | str] = {"training_pushes": number}
            condition = Condition(label=label, factors=factors)
            chosen = replace(usual, expected_cost=is_expected, pushes=most)
            yield RunTrials((fitted,), chosen, condition)


STUDY = Study(
    question="With few training pushes, does planning with expected costs solve more "
    "goals?",
    plan=_plan,
)
