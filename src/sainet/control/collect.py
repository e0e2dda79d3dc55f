"""Collecting sessions: many pushes through a robot, kept one by one, and a dataset.

Random pushes have the paper's distributions: the disks touch, the pusher touches disk 1
within 60 degrees of the axis of the disks, and pushes within 30 degrees of the contact
normal. Between pushes the disks stay where they were left. They are arranged anew, at a
random place and heading, if neighbours no longer touch or a centre left the work area:
most starts are as a robot without an operator would meet them, and all of the surface
is covered.

The random numbers of a push depend only on the seed and its index, and a simulation is
set to the poses that the push before left: resumed sessions equal uninterrupted ones.
"""

from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import jax.numpy as jnp
import msgspec
import numpy as np
from jaxtyping import Float

from sainet.control.collected import (
    REMEDY,
    PushDocument,
    import_recordings,
    read_push,
    write_push,
)
from sainet.control.config import CollectConfig
from sainet.control.episode import MOST_TROUBLES, checked
from sainet.control.trial import assumed_frictions
from sainet.datasets.store import Store, open_store
from sainet.models.library import load_model
from sainet.models.model import Model
from sainet.planning import make_planner
from sainet.robots import make_robot
from sainet.robots.base import AbstractRobot
from sainet.runs.documents import read_document, write_document
from sainet.runs.errors import BadInput, SainetError
from sainet.runs.folders import open_run, remake
from sainet.scenes.pushes import Push, PushGrid, push_axis
from sainet.scenes.scene import TIME_STEP
from sainet.scenes.state import State
from sainet.tasks.push_to_goal import PushToGoal, draw_goal
from sainet.worlds.sampling import scattered

DATASET, RECORDINGS, SUMMARY = "dataset", "recordings", "collected.json"
_STREAM = 0xC011
_ATTEMPTS = 5  # to arrange disks
_SAME_GOAL = 60  # pushes, after which a planned session turns to another goal


class Collected(msgspec.Struct, frozen=True, kw_only=True):
    """The result of a session."""

    pushes: int  # recorded
    usable: int  # in the dataset
    arrangements: int  # pushes before which the disks were arranged
    troubles: dict[str, int]  # pushes that are not in the dataset, by reason
    seal: str = ""  # hash of all other fields


def collect(
    config: CollectConfig,
    out: Path,
    *,
    on_pushes: Callable[[int], None] = lambda pushes: None,
) -> Store:
    """Record pushes, and return the dataset of those without trouble.

    Args:
        config: robot and pushes.
        out: run folder, with one file per push; identical settings resume.
        on_pushes: called with the number of pushes that were recorded since.

    Raises:
        RunConflict: the folder belongs to another run.
        BadInput: a recording is damaged, or none can be used.
        SainetError: the robot failed several times in a row.
    """
    model = _planning_model(config)
    name = model.name if model else config.model  # not the spelling of its folder
    known = {"command": "record", "weights": model and model.digest, "model": name}
    settings = {**config.settings(), **known}
    folder = open_run(out, settings, finished_by=SUMMARY)
    if not folder.is_finished:
        _record(config, out, model, on_pushes)
        _import(config, out, settings)
    return open_store(out / DATASET)


def rehearse(config: CollectConfig, *, on_pushes: Callable[[int], None]) -> None:
    """Show the commands of a dry run; nothing is sent, moved or written."""
    model = _planning_model(config)
    with make_robot(config, config.seed) as robot:
        session = _Session(config, robot, model)
        for index in range(config.pushes):
            session.push(index, None)
            on_pushes(1)


def summary_of(out: Path) -> Collected:
    """Return the result of the finished session in a folder."""
    return read_document(out / SUMMARY, Collected, remedy=remake(out))


def push_file(out: Path, index: int) -> Path:
    """Return the file of one push."""
    return out / RECORDINGS / f"{index:06d}.json"


def _planning_model(config: CollectConfig) -> Model | None:
    """Return the model that plans; None for random pushes."""
    if config.planner is None:
        return None
    model = load_model(config.model)
    model.check_fits("robot", TIME_STEP)
    return model


def _record(
    config: CollectConfig,
    out: Path,
    model: Model | None,
    on_pushes: Callable[[int], None],
) -> None:
    """Record the pushes that are missing, in order."""
    indices = range(config.pushes)
    first = next((i for i in indices if not push_file(out, i).is_file()), len(indices))
    on_pushes(first)
    if first == len(indices):
        return
    last = read_push(push_file(out, first - 1)) if first else None
    troubles = 0
    with make_robot(config, config.seed) as robot:
        session = _Session(config, robot, model)
        for index in indices[first:]:
            last = session.push(index, last)
            write_push(push_file(out, index), last)
            on_pushes(1)
            troubles = troubles + 1 if last.trouble else 0
            if troubles == MOST_TROUBLES:
                raise SainetError(
                    f"{out}: {last.trouble}, {troubles} times in a row; repair that, "
                    "then run the same command to resume."
                )


def _import(config: CollectConfig, out: Path, settings: Mapping[str, object]) -> None:
    """Make the dataset, then the summary, which completes the session."""
    files = [push_file(out, index) for index in range(config.pushes)]
    found = [read_push(file) for file in files]
    properties = found[0].properties()
    for file, each in zip(files, found, strict=True):
        if each.properties() != properties:
            raise BadInput(f"{file}: its disks are not those of push 0; {REMEDY}.")
    recordings = [each.recording() for each in found]
    collected = import_recordings(out / DATASET, settings, recordings, properties)
    summary = Collected(
        pushes=len(found),
        usable=collected.store.info.pushes,
        arrangements=sum(each.arranged for each in found),
        troubles=dict(Counter(collected.troubles)),
    )
    write_document(out / SUMMARY, summary)


@dataclass(frozen=True)
class _Session:
    """A robot, and how its pushes are chosen."""

    config: CollectConfig
    robot: AbstractRobot
    model: Model | None  # that plans; None: random pushes

    def push(self, index: int, last: PushDocument | None) -> PushDocument:
        """Execute one push, after another one."""
        config, robot = self.config, self.robot
        rng = np.random.default_rng([_STREAM, config.seed, index // config.repeats])
        push = _random_push(rng)
        robot.resume(last and last.left.state(), config.seed, index)
        observed = robot.observe()
        arranged = last is None or config.repeats > 1 or not self._is_usable(observed)
        if arranged:
            observed = self._arrange(rng)
        goal = None
        if self.model is not None:
            goal = self._goal(observed, None if arranged else last, index)
            push = self._planned(self.model, observed, goal)
        recording = checked(robot.push(push), push)
        if config.repeats > 1:
            recording = replace(recording, plan=str(index // config.repeats))
        return PushDocument.of(
            recording,
            index=index,
            arranged=arranged,
            robot=robot,
            observed=observed,
            goal=goal,
        )

    def _is_usable(self, state: State) -> bool:
        """Return whether neighbouring disks touch, all of them in the work area."""
        place = np.asarray(state.position, np.float64)
        radius = np.asarray(self.robot.scene.radius)
        reach = radius[:-1] + radius[1:]
        gaps = np.linalg.norm(np.diff(place, axis=0), axis=1) - reach
        touching = 1000 * np.abs(gaps) <= self.config.gap_mm
        return bool(touching.all() and 2000 * np.abs(place).max() <= self._side)

    @property
    def _side(self) -> float:
        """Side of the work area (mm), with room for errors of placing."""
        return self.config.area_mm + 2 * self.config.gap_mm

    def _arrange(self, rng: np.random.Generator) -> State:
        """Return the measured poses after arranging the disks at random."""
        radius = np.asarray(self.robot.scene.radius)
        wanted = scattered(rng, radius, self.config.area_mm / 1000)
        for _ in range(_ATTEMPTS):
            self.robot.arrange(wanted)
            observed = self.robot.observe()
            if self._is_usable(observed):
                return observed
        raise SainetError(
            f"the disks were arranged {_ATTEMPTS} times, and do not touch or are out "
            "of the work area; check radii and tracker, or increase `gap_mm`."
        )

    def _goal(
        self, observed: State, last: PushDocument | None, index: int
    ) -> Float[np.ndarray, "2"]:
        """Return the goal of the push before, or another one if that has ended."""
        scene, moved = self.robot.scene, observed.body_count - 1
        if last is not None and last.goal is not None and index % _SAME_GOAL:
            goal = np.array(last.goal, np.float64)
            if not _task(goal, moved).is_solved(scene, observed):
                return goal
        return draw_goal(
            self.config.goals,
            self.config.seed,
            index,
            disk=np.asarray(observed.position)[moved],
            axis=float(push_axis(observed)),
            radius=float(scene.radius[moved]),
        )

    def _planned(
        self, model: Model, observed: State, goal: Float[np.ndarray, "2"]
    ) -> Push:
        """Return the push that a planner chooses towards the goal."""
        task = _task(goal, observed.body_count - 1)
        planner = make_planner(str(self.config.planner))
        given = assumed_frictions(self.robot.scene)
        return planner.plan(model.dynamics, task, given, observed).pushes[0]


def _task(goal: Float[np.ndarray, "2"], moved: int) -> PushToGoal:
    return PushToGoal(jnp.asarray(goal, jnp.float32), moved)


def _random_push(rng: np.random.Generator) -> Push:
    """Return a push with the paper's distributions of angles."""
    grid = PushGrid()
    return Push(
        contact_angle=rng.uniform(-1, 1) * grid.contact_range,
        direction=rng.uniform(-1, 1) * grid.direction_range,
        length=grid.length,
        speed=grid.speed,
    )
