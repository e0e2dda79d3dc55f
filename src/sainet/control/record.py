"""Records of episodes: decision, prediction and measured poses of every push."""

import functools
import math
from pathlib import Path
from typing import Annotated, Any

import msgspec
import numpy as np
from jaxtyping import Float

from sainet.control.config import ControlConfig
from sainet.control.episode import ControlStep, Episode
from sainet.control.trial import Trial
from sainet.datasets.recorded.resample import pusher_track
from sainet.runs.documents import read_document
from sainet.runs.errors import BadInput, shown
from sainet.runs.folders import remake
from sainet.scenes import quantities
from sainet.scenes.recording import Recording
from sainet.scenes.scene import TIME_STEP
from sainet.scenes.state import State, poses_of

SUMMARY = "episodes.json"
FOLDER = "episodes"
_EVERY = 8  # steps of 1/240 s between the recorded poses of a path: 1/30 s

_LEAST_MM = 1e-6  # length of a way
_agree = functools.partial(math.isclose, rel_tol=1e-5, abs_tol=0.05)  # mm
_NO_NEARER = 10  # pushes

# In mm and degrees. None: the simulation produced NaN or infinity.
_Place = quantities.Finite | None
_Pose = Annotated[list[_Place], msgspec.Meta(min_length=3, max_length=3)]
_Point = Annotated[list[_Place], msgspec.Meta(min_length=2, max_length=2)]
_Positive = Annotated[float, msgspec.Meta(gt=0, le=1e6)]
_Count = Annotated[int, msgspec.Meta(ge=0, le=1_000_000)]
_RadiusMm = Annotated[float, quantities.RADIUS.times(1000, "mm").meta]
_PusherRadiusMm = Annotated[float, quantities.PUSHER_RADIUS.times(1000, "mm").meta]


class StepRecord(msgspec.Struct, kw_only=True):
    """One control step: a decision and its push."""

    contact_angle_deg: _Place = None
    direction_deg: _Place = None
    length_mm: _Place = None
    speed_mm_s: _Place = None
    observed: list[_Pose]  # of each disk, before the push
    distance_mm: _Place  # of the target disk from the goal, as observed
    planned_pushes: _Count = 1
    planned: list[list[_Pose]]  # predicted poses by time and disk
    planned_distance_mm: _Place = None
    evaluated: _Count = 0  # candidate pushes
    is_complete: bool = True  # False: the deadline ended the search
    warnings: list[str] = []
    actual: list[list[_Pose]]  # measured poses by time and disk
    pusher: list[_Point]  # by time
    trouble: str | None = None


class EpisodeRecord(msgspec.Struct, kw_only=True):
    """One episode; lengths in mm, angles in degrees."""

    trial: _Count
    model: str
    goals: str
    reason: str
    solved: bool
    final_mm: _Place  # true distance of the target disk from the goal
    pushes: _Count
    final: list[_Pose]  # true pose of each disk
    decision_s: list[quantities.Size]
    goal_mm: Annotated[
        list[quantities.Finite], msgspec.Meta(min_length=2, max_length=2)
    ]
    moved: _Count  # index of the target disk
    radius_mm: Annotated[
        list[_RadiusMm], msgspec.Meta(min_length=1, max_length=quantities.MOST_DISKS)
    ]
    pusher_radius_mm: _PusherRadiusMm
    tolerance_mm: _Positive
    table_friction: quantities.Friction
    steps: list[StepRecord] = msgspec.field(name="turns")
    seal: str = ""  # hash of all other fields

    @property
    def overshoot_mm(self) -> float:
        """The most that the target disk was beyond its goal, seen from its start."""
        path = self._path
        start = path[0]
        way = np.array(self.goal_mm) - start
        distance = max(float(np.linalg.norm(way)), _LEAST_MM)
        beyond = (path - start) @ way / distance - distance
        return float(np.nanmax(beyond, initial=0.0))

    @property
    def is_stuck(self) -> bool:
        """Whether the last pushes came no nearer to the goal, which was not reached."""
        away = np.linalg.norm(self._path - np.array(self.goal_mm), axis=1)
        away[~np.isfinite(away)] = np.inf
        return not self.solved and int(np.argmin(away)) + _NO_NEARER < len(away)

    def _check_end(self) -> None:
        """Raise `ValueError` if pose, distance, tolerance and outcome contradict."""
        end = [math.inf if x is None else x for x in self.final[self.moved][:2]]
        away = math.inf if self.final_mm is None else self.final_mm
        if not _agree(away, math.dist(end, self.goal_mm)):
            raise ValueError(f"final_mm is {away:g}, but final is elsewhere")
        most = self.tolerance_mm
        if self.solved != (away < most) and not _agree(away, most):
            raise ValueError(
                f"solved is {self.solved}, but final_mm is {away:g} and tolerance_mm "
                f"{most:g}"
            )

    @property
    def _path(self) -> Float[np.ndarray, "observation 2"]:
        """Places of the target disk (mm) before each push, and at the end."""
        poses = [step.observed for step in self.steps]
        found = [each[self.moved][:2] for each in (*poses, self.final)]
        return np.array(found, np.float64)

    def __post_init__(self) -> None:
        """Check lengths that depend on each other."""
        disks = len(self.radius_mm)
        if not 0 <= self.moved < disks:
            raise ValueError(f"moved is {self.moved} of {disks} disks")
        if len(self.final) != disks:
            raise ValueError(f"final has {len(self.final)} of {disks} disks")
        self._check_end()
        for index, step in enumerate(self.steps):
            paths = [step.observed, *step.planned, *step.actual]
            if {len(poses) for poses in paths} != {disks}:
                raise ValueError(f"turns[{index}] does not have {disks} disks")
            if len(step.pusher) != len(step.actual):
                raise ValueError(f"turns[{index}]: pusher and actual differ in length")


class Finished(msgspec.Struct):
    """The files of a finished run, relative to its folder; written last."""

    episodes: list[str]
    seal: str = ""  # hash of all other fields


def record(
    config: ControlConfig,
    index: int,
    trial: Trial,
    episode: Episode,
    end: State | None = None,
) -> EpisodeRecord:
    """Return the record of an episode; lengths in mm, angles in degrees.

    Where no `end` is given, `solved` uses the true pose, not the measured pose, which
    is noisy. NaN and infinity become None.
    """
    task, robot = trial.task, trial.robot
    end = end or robot.truth
    return EpisodeRecord(
        trial=index,
        model=config.model,
        goals=config.goals,
        reason=episode.reason,
        solved=bool(task.is_solved(robot.scene, end)),
        final_mm=_known(1000 * float(task.distance(end))),
        pushes=len(episode.steps),
        final=listed_poses(poses_of(end)),
        decision_s=[step.seconds for step in episode.steps],
        goal_mm=_mm(task.goal),
        moved=task.moved,
        radius_mm=_mm(robot.scene.radius),
        pusher_radius_mm=1000 * float(robot.scene.pusher_radius),
        tolerance_mm=1000 * task.tolerance * float(robot.scene.radius[task.moved]),
        table_friction=float(robot.scene.table_friction),
        steps=[record_step(trial, step) for step in episode.steps],
    )


def read_record(path: Path) -> EpisodeRecord:
    """Read the record of an episode, checked against `EpisodeRecord`.

    Raises:
        BadInput: it is damaged, or the record of another episode.
    """
    remedy = "delete it and run the same command: that episode is run again"
    found = read_document(path, EpisodeRecord, remedy=remedy)
    if f"{found.trial:03d}" != path.stem:
        raise BadInput(
            f"{path}: trial is {found.trial}, which is another episode; {remedy}."
        )
    return found


def episode_file(out: Path, trial: int) -> Path:
    """Return the file of the record of an episode."""
    return out / FOLDER / f"{trial:03d}.json"


def episode_files(out: Path) -> list[Path]:
    """Return the files of all recorded episodes of a run folder.

    Raises:
        BadInput: the run is finished and an episode is missing.
    """
    files = sorted((out / FOLDER).glob("[0-9]*.json"))
    files = [path for path in files if path.suffixes == [".json"]]
    if (out / SUMMARY).exists():
        remedy = remake(out)
        for name in read_document(out / SUMMARY, Finished, remedy=remedy).episodes:
            if out / name not in files:
                raise BadInput(
                    f"{out / shown(name)}: this episode is missing; {remedy}."
                )
    return files


def record_step(trial: Trial, step: ControlStep) -> StepRecord:
    """Return the record of one control step."""
    recording, plan = step.recording, step.plan
    pose, pusher = _drawn(recording)
    push = recording.commanded or plan.pushes[0]
    return StepRecord(
        contact_angle_deg=_degrees(push.contact_angle),
        direction_deg=_degrees(push.direction),
        length_mm=_known(1000 * float(push.length)),
        speed_mm_s=_known(1000 * float(push.speed)),
        observed=listed_poses(poses_of(step.observed)),
        distance_mm=_known(1000 * float(trial.task.distance(step.observed))),
        planned_pushes=len(plan.pushes),
        planned=listed_poses(plan.path[_EVERY - 1 :: _EVERY]),
        planned_distance_mm=_known(1000 * plan.distance),
        evaluated=plan.evaluated,
        is_complete=plan.is_complete,
        warnings=list(plan.warnings),
        actual=listed_poses(pose),
        pusher=_mm(pusher),
        trouble=recording.trouble or None,
    )


def _drawn(recording: Recording) -> tuple[np.ndarray, np.ndarray]:
    """Return the poses of the disks every 1/30 s, and the pusher at their times."""
    time, pose, pusher = recording.time, recording.pose, recording.pusher
    known = np.isfinite(pose).all(axis=(1, 2))
    if not known.all() and known.any():  # the disks have a clock of their own
        time, pose = time[known], pose[known]
        pusher = pusher_track(recording).at(time)
    steps = (time - time[:1]) / TIME_STEP + 0.5  # half a step early is in time
    rows = np.searchsorted(steps, np.arange(_EVERY, steps.max(initial=0.0), _EVERY))
    return pose[rows], pusher[rows]


def _known(value: float) -> float | None:
    """Return a number, None for NaN and infinity."""
    return value if math.isfinite(value) else None


def listed_poses(pose: Float[np.ndarray, "*shape 3"]) -> list[Any]:
    """Return x and y in mm and the angle in degrees, rounded to 0.01."""
    return listed(np.asarray(pose, np.float64) * [1000, 1000, np.rad2deg(1)], 2)


def _mm(metres: object) -> list[Any]:
    return listed(1000 * np.asarray(metres, np.float64), 2)


def listed(values: object, digits: int | None = None) -> list[Any]:
    """Return numbers, None for NaN and infinity; rounded, or exact."""
    found = np.asarray(values, np.float64)
    numbers = (found if digits is None else np.round(found, digits)).astype(object)
    numbers[~np.isfinite(found)] = None
    return numbers.tolist()


def _degrees(radians: object) -> float | None:
    return _known(float(np.rad2deg(np.asarray(radians, np.float64))))
