"""The session behind the page: a world, models, and answers to messages."""

from dataclasses import dataclass, field, replace

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from sainet.control.config import ControlConfig
from sainet.control.episode import ControlStep, Episode, checked
from sainet.control.record import record_step
from sainet.control.trial import Trial, with_goal
from sainet.control.worlds import in_world, world_of
from sainet.models.library import Model, load_model
from sainet.planning.base import Plan
from sainet.planning.checks import check_observation, doubts
from sainet.report.live.album import CHOSEN, Album, Take
from sainet.report.live.config import PlayConfig
from sainet.report.live.messages import (
    Action,
    Aim,
    BadMessage,
    ChooseModel,
    ChooseWorld,
    Message,
    MoveDisk,
    MoveGoal,
    Notice,
    PlanNow,
    PushNow,
    Restart,
    Save,
    SetProperties,
)
from sainet.report.live.predictions import Moment, Predictor, push_at
from sainet.report.live.table import Table, moved_apart, with_disk_at
from sainet.report.live.views import Ghosts, Moved, View, compared, view_of
from sainet.report.live.workshop import OnStatus, Workshop
from sainet.report.live.world import Properties, make_world
from sainet.scenes.pushes import Push
from sainet.scenes.scene import TIME_STEP
from sainet.scenes.state import poses_of

Answer = View | Ghosts | Moved | Notice
_MOST_PUSHES = 200  # of an episode


@dataclass
class Session:
    """A world with disks and a goal, models that predict, one that plans.

    `predict` may be called while `act` works in another thread: it reads one moment,
    which `act` replaces as a whole.
    """

    config: PlayConfig
    on_status: OnStatus = lambda status: None
    predictor: Predictor = field(init=False)
    album: Album = field(init=False)
    trial: Trial = field(init=False)
    moment: Moment = field(init=False)

    def __post_init__(self) -> None:
        """Load the models and put the disks in a row.

        Raises:
            BadInput: a model or the world is unknown or cannot be used.
        """
        self.predictor = Predictor({n: _loaded(n) for n in self.config.model})
        self._workshop = Workshop(self.predictor, self.on_status)
        self.album = Album(self.config.out)
        self._control, self._index = self.config.control(), 0
        self._goals: str = self._control.goals
        self._properties: Properties | None = None
        self._episode = Episode()
        self._use(_new_trial(self._control, None, self._index))

    def predict(self, aim: Aim) -> Ghosts:
        """Return what the models predict for a push."""
        moment, push = self.moment, push_at(aim.contact_angle_deg, aim.direction_deg)
        try:
            moment.check_start(push)
        except BadMessage as blocked:
            return Ghosts(
                number=aim.number,
                against="",
                reference=[],
                ghosts=[],
                blocked=str(blocked),
            )
        paths = self.predictor.paths(moment, push)
        first = next(iter(paths))
        return compared(
            paths,
            paths[first][-1],
            number=aim.number,
            against=first,
            warnings=self._doubts(moment, push),
        )

    def act(self, message: Message) -> list[Answer]:
        """Do what a message asks for and return the answers.

        Raises:
            BadInput: the message cannot be followed; nothing has changed.
        """
        match message:
            case Aim():
                return [self.predict(message)]
            case MoveDisk() | MoveGoal():
                self._move(message)
            case _:
                return self._follow(message)
        return [self.view]

    @property
    def view(self) -> View:
        """What the page shows of the world."""
        pushes = len(self._episode.steps)
        return view_of(
            self.trial,
            self._control,
            self._table,
            pushes=pushes,
            episodes=len(self.album) + bool(pushes),
        )

    def compile(self) -> None:
        """Compile what the page may ask for, for this world and number of disks."""
        self._workshop.prepare(self._control)

    def _follow(self, message: Action) -> list[Answer]:
        match message:
            case PushNow():
                return [self._push(message)]
            case PlanNow():
                return [self._plan()]
            case ChooseModel():
                self._choose_model(message)
            case ChooseWorld():
                self._choose_world(message)
            case SetProperties():
                self._set_properties(message)
            case Restart():
                self._restart(self._control)
            case Save():
                return [self._save(), self.view]
        return [self.view]

    def _push(self, message: PushNow) -> Moved:
        moment = self.moment
        push = push_at(message.contact_angle_deg, message.direction_deg)
        moment.check_start(push)
        path = self.predictor.paths(moment, push)[self._control.model]
        goal, target = np.asarray(self.trial.task.goal), path[-1, self.trial.task.moved]
        plan = Plan(
            pushes=(push,),
            predict=lambda: path,
            cost=np.nan,
            distance=float(np.linalg.norm(target[:2] - goal)),
            evaluated=0,
            warnings=tuple(self._doubts(moment, push)),
        )
        return self._execute(plan)

    def _plan(self) -> Moved:
        trial = self.trial
        plan = self._workshop.planner.plan(
            self._model.dynamics, trial.task, trial.scene, self.moment.observed
        )
        return self._execute(plan)

    def _execute(self, plan: Plan) -> Moved:
        """Push, observe, and compare predictions with the outcome."""
        trial, moment, push = self.trial, self.moment, plan.pushes[0]
        paths = self.predictor.paths(moment, push)
        recording = checked(trial.robot.push(push), push)
        step = ControlStep(moment.observed, plan, recording, 0.0, trial.scene)
        self._episode.steps.append(step)
        outcome = poses_of(trial.robot.truth)
        if not np.isfinite(outcome).all():
            self._restart(self._control)
            raise BadMessage(f"{recording.trouble}; the disks are in a row again.")
        self._observe()
        moved = Moved(
            step=record_step(trial, step),
            ghosts=compared(paths, outcome, number=0, against="world"),
            view=self.view,
        )
        if len(self._episode.steps) == _MOST_PUSHES:
            self._close()
        return moved

    def _move(self, message: MoveDisk | MoveGoal) -> None:
        place = np.array([message.x_mm, message.y_mm]) / 1000
        if isinstance(message, MoveGoal):
            self._table.check(place, "The goal")
            self._close()
            self._set_goal(jnp.asarray(place, jnp.float32))
            self._goals = CHOSEN
            return
        robot, disk, disks = self.trial.robot, message.disk - 1, self._control.disks
        if not 0 <= disk < disks:
            raise BadMessage(
                f"There is no disk {message.disk}; there are disks 1 to {disks}."
            )
        self._table.check(place, f"Disk {message.disk}")
        robot.arrange(with_disk_at(robot.scene, robot.truth, disk, place))
        self._observe()

    def _choose_model(self, message: ChooseModel) -> None:
        known = ", ".join(self.predictor.models)
        if message.model not in self.predictor.models:
            raise BadMessage(f"No model of this page has that name; choose {known}.")
        control = replace(self._control, model=message.model)
        self._workshop.prepare(control)
        self._close()
        self._control = control

    def _choose_world(self, message: ChooseWorld) -> None:
        control = self._control.with_disks(message.disks)
        control = replace(control, noise_level=message.noise)
        self._restart(in_world(control, message.world))

    def _restart(self, control: ControlConfig) -> None:
        """Start an episode with the disks in a row and another goal."""
        now = self._control
        stay = (control.disks, control.robot) == (now.disks, now.robot)
        properties = self._properties if stay else None
        trial = _new_trial(control, properties, self._index + 1)
        self._workshop.prepare(control)
        self._close()
        self._properties = properties
        self._control, self._index = control, self._index + 1
        self._goals = control.goals
        self._use(trial)

    def _set_properties(self, message: SetProperties) -> None:
        trial, disks = self.trial, self._control.disks
        if world_of(self._control) == "lab":
            raise BadMessage("The virtual lab's properties are hidden.")
        if {len(message.mass_kg), len(message.radius_mm)} != {disks}:
            raise BadMessage(f"Properties are not those of {disks} disks.")
        properties = Properties.of(message)
        changed = _new_trial(self._control, properties, self._index + 1)
        self._close()
        self._properties, self._index = properties, self._index + 1
        apart = moved_apart(changed.robot.scene, trial.robot.truth)
        changed.robot.arrange(apart)
        self._use(changed)
        self._set_goal(trial.task.goal)

    def _save(self) -> Notice:
        episodes = self.album.save(self._taken)
        if not episodes:
            raise BadMessage("There is no push to save yet.")
        return Notice(
            f"Saved {episodes} episode{'s' * (episodes > 1)} in {self.album.out}; "
            f"'sainet report {self.album.out}' makes a page of it.",
            is_error=False,
        )

    def _close(self) -> None:
        """End the episode; its record is kept if it has a push."""
        self.album.add(self._taken)
        self._episode = Episode()

    @property
    def _taken(self) -> Take:
        return Take(self._control, self._goals, self.trial, self._episode)

    def _use(self, trial: Trial) -> None:
        self.trial, self._table = trial, Table.for_disks(self._control.disks)
        self._observe()

    def _observe(self) -> None:
        self.moment = Moment(self.trial.scene, self.trial.robot.observe())

    def _set_goal(self, goal: Float[Array, " 2"]) -> None:
        task = replace(self.trial.task, goal=goal)
        self.trial = self.trial._replace(task=task)

    def _doubts(self, moment: Moment, push: Push) -> list[str]:
        gap = check_observation(moment.scene, moment.observed)
        return list(doubts(self._model.dynamics, gap, (push,)))

    @property
    def _model(self) -> Model:
        return self.predictor.models[self._control.model]


def _new_trial(control: ControlConfig, own: Properties | None, index: int) -> Trial:
    return with_goal(control, index, make_world(control, own, index))


def _loaded(name: str) -> Model:
    model = load_model(name)
    model.check_fits("robot", TIME_STEP)
    return model
