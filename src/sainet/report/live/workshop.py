"""Compiling everything that the page may ask for, before it asks."""

from collections.abc import Callable
from dataclasses import dataclass, field

from sainet.control.config import ControlConfig
from sainet.control.trial import Trial, with_goal
from sainet.control.worlds import WorldName, world_of
from sainet.planning import make_planner
from sainet.planning.base import AbstractPlanner
from sainet.report.live.messages import Status
from sainet.report.live.predictions import Moment, Predictor, push_at
from sainet.report.live.world import make_world

OnStatus = Callable[[Status], None]
_Key = tuple[WorldName, int, bool]  # world, disks, whether there is noise


@dataclass
class Workshop:
    """Compiles predictions, pushes and the planner for worlds, models and disk counts.

    It pushes in a world of its own, so that no noise of the session is drawn.
    """

    predictor: Predictor
    on_status: OnStatus
    planner: AbstractPlanner = field(default_factory=lambda: make_planner("greedy"))
    _disks: set[int] = field(default_factory=set)
    _worlds: set[_Key] = field(default_factory=set)
    _planning: set[tuple[str, int]] = field(default_factory=set)

    def prepare(self, control: ControlConfig) -> None:
        """Compile what these settings need and is not compiled yet.

        Raises:
            BadInput: the world or the model cannot be used.
        """
        disks, model = control.disks, control.model
        world = (world_of(control), disks, control.noise_level != "none")
        try:
            if disks not in self._disks:
                self._say("Compiling predictions", can_predict=False)
                self._predict(control)
                self._disks.add(disks)
            if world not in self._worlds:
                self._say("Compiling pushes")
                _trial(control).robot.push(push_at(0.0, 0.0))
                self._worlds.add(world)
            if (model, disks) not in self._planning:
                self._say("Compiling the planner")
                self._plan(control)
                self._planning.add((model, disks))
        finally:
            self.on_status(Status("Ready", is_ready=True, can_predict=True))

    def _predict(self, control: ControlConfig) -> None:
        trial = _trial(control)
        self.predictor.compile(Moment(trial.scene, trial.robot.observe()))

    def _plan(self, control: ControlConfig) -> None:
        trial, model = _trial(control), self.predictor.models[control.model]
        observed = trial.robot.observe()
        self.planner.plan(model.dynamics, trial.task, trial.scene, observed)

    def _say(self, text: str, *, can_predict: bool = True) -> None:
        self.on_status(Status(f"{text} …", is_ready=False, can_predict=can_predict))


def _trial(control: ControlConfig) -> Trial:
    trial = with_goal(control, 0, make_world(control, None, 0))
    trial.robot.observe()
    return trial
