"""Collected pushes: one document with everything about one push, and their dataset."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

import jax.numpy as jnp
import msgspec
import numpy as np

from sainet.control.record import listed
from sainet.datasets.recorded.checks import recording_problems
from sainet.datasets.recorded.importing import import_pushes
from sainet.datasets.recorded.properties import Properties
from sainet.datasets.recorded.resample import resample
from sainet.datasets.store import Store
from sainet.robots.base import AbstractRobot
from sainet.runs.documents import read_document, sealed_fields, write_bytes
from sainet.runs.errors import BadInput
from sainet.scenes.pushes import Push
from sainet.scenes.quantities import PUSHER_RADIUS, Finite, Mass, Radius
from sainet.scenes.recording import Conditions, Recording
from sainet.scenes.state import State, at_rest, poses_of

_Known = Finite | None  # None: unknown
_Pose = Annotated[list[_Known], msgspec.Meta(min_length=3, max_length=3)]
_Point = Annotated[list[_Known], msgspec.Meta(min_length=2, max_length=2)]
_DIGITS = 9  # after the point: nanometres and nanoseconds
REMEDY = "delete it and run the same command: later pushes are made again"


class Command(msgspec.Struct, frozen=True, kw_only=True):
    """A push as it was sent."""

    contact_angle: Finite  # rad
    direction: Finite  # rad
    length: Finite  # m
    speed: Finite  # m/s

    @classmethod
    def of(cls, push: Push) -> "Command":
        """Return the command of one push."""
        return cls(
            **{name: float(getattr(push, name)) for name in cls.__struct_fields__}
        )

    def push(self) -> Push:
        """Return the push."""
        return Push(**msgspec.structs.asdict(self))


class Place(msgspec.Struct, frozen=True, kw_only=True):
    """Poses of disks at rest, and where the pusher is; exact."""

    pose: list[_Pose]  # m, m, rad
    pusher: _Point  # m

    @classmethod
    def of(cls, state: State) -> "Place":
        """Return the poses of a state."""
        return cls(pose=listed(poses_of(state)), pusher=listed(state.pusher_position))

    def state(self) -> State:
        """Return the state at rest."""
        pose = jnp.asarray(_array(self.pose), jnp.float32)
        pusher = jnp.asarray(_array(self.pusher), jnp.float32)
        return at_rest(pose[:, :2], pose[:, 2], pusher)


class PushDocument(msgspec.Struct, frozen=True, kw_only=True):
    """Everything about one collected push. Lengths in m, angles in rad, times in s."""

    index: Annotated[int, msgspec.Meta(ge=0)]
    arranged: bool  # whether the disks were put in place before
    observed: Place  # before the push, as measured
    left: Place  # after the push: true poses in simulation
    mass: list[Mass]  # kg, of each disk
    radius: list[Radius]  # m
    pusher_radius: Annotated[float, PUSHER_RADIUS.meta]  # m
    goal: _Point | None = None  # of a planned push
    time: list[Finite]
    pose: list[list[_Pose]]  # measured, by time and disk
    pusher: list[_Point]
    commanded: Command | None
    surface: str = ""
    speed_mm_s: Finite | None = None
    plan: str = ""  # equal for repetitions of one push
    trouble: str = ""
    seal: str = ""  # hash of all other fields

    def __post_init__(self) -> None:
        """Check that all samples have a time, a pusher and all disks."""
        disks = len(self.left.pose)
        if {len(self.time), len(self.pusher)} != {len(self.pose)}:
            raise ValueError("time, pose and pusher differ in length")
        if {len(self.mass), len(self.radius)} != {disks}:
            raise ValueError(f"mass or radius is not of {disks} disks")
        if any(len(poses) != disks for poses in self.pose):
            raise ValueError(f"a sample of pose does not have {disks} disks")

    @classmethod
    def of(
        cls,
        recording: Recording,
        *,
        index: int,
        arranged: bool,
        robot: AbstractRobot,
        observed: State,
        goal: np.ndarray | None,
    ) -> "PushDocument":
        """Return the document of what a robot recorded, and of the circumstances."""
        push, conditions = recording.commanded, recording.conditions
        return cls(
            index=index,
            arranged=arranged,
            observed=Place.of(observed),
            left=Place.of(robot.truth),
            mass=listed(robot.scene.mass),
            radius=listed(robot.scene.radius),
            pusher_radius=float(robot.scene.pusher_radius),
            goal=None if goal is None else listed(goal),
            time=listed(recording.time, _DIGITS),
            pose=listed(recording.pose, _DIGITS),
            pusher=listed(recording.pusher, _DIGITS),
            commanded=None if push is None else Command.of(push),
            surface=conditions.surface,
            speed_mm_s=conditions.speed_mm_s,
            plan=recording.plan,
            trouble=recording.trouble,
        )

    def properties(self) -> Properties:
        """Return masses and radii of the disks; frictions are assumed, never true."""
        return Properties(
            bodies=tuple(f"disk {number + 1}" for number in range(len(self.mass))),
            mass=tuple(self.mass),
            radius=tuple(self.radius),
            pusher_radius=self.pusher_radius,
        )

    def recording(self) -> Recording:
        """Return the recording."""
        return Recording(
            time=np.array(self.time),
            pose=_array(self.pose).reshape(-1, len(self.left.pose), 3),
            pusher=_array(self.pusher).reshape(-1, 2),
            commanded=self.commanded.push() if self.commanded else None,
            conditions=Conditions(surface=self.surface, speed_mm_s=self.speed_mm_s),
            plan=self.plan,
            source=f"push {self.index}",
            trouble=self.trouble,
        )


def write_push(path: Path, document: PushDocument) -> None:
    """Write a collected push on one line: indented, it would be thrice as long."""
    write_bytes(path, msgspec.json.encode(sealed_fields(document)) + b"\n")


def read_push(path: Path) -> PushDocument:
    """Read a collected push.

    Raises:
        BadInput: the file is damaged, or of another push.
    """
    found = read_document(path, PushDocument, remedy=REMEDY)
    if f"{found.index:06d}" != path.stem:
        raise BadInput(f"{path}: index is {found.index}: another push; {REMEDY}.")
    return found


@dataclass(frozen=True)
class Imported:
    """A dataset of the pushes that were executed as commanded."""

    store: Store
    troubles: Mapping[str, int]  # number of pushes that were left out, by reason


def import_recordings(
    out: Path,
    settings: Mapping[str, object],
    recordings: Sequence[Recording],
    properties: Properties,
) -> Imported:
    """Make a dataset of recordings, without those in trouble.

    Args:
        out: run folder.
        settings: JSON values that identify the recordings.
        recordings: of disks with these properties.
        properties: masses and radii as measured, frictions as assumed.

    Raises:
        BadInput: no recording can be used.
        RunConflict: the folder holds something else.
    """
    usable: list[Recording] = []
    troubles: Counter[str] = Counter()
    for each in recordings:
        recording = each if each.trouble else _unwrapped(each)
        if reason := _reason(recording, properties):
            troubles[reason] += 1
        else:
            usable.append(recording)
    if not usable:
        ((worst, _),) = troubles.most_common(1) or [("none was recorded", 0)]
        raise BadInput(
            f"{out}: no push can be used (most often: {worst}); repair that, and "
            "record others."
        )
    pushes = [resample(each) for each in usable]
    return Imported(import_pushes(out, settings, pushes, properties), troubles)


def _unwrapped(recording: Recording) -> Recording:
    """Return a recording whose angles have no jumps of full turns."""
    pose = np.array(recording.pose, np.float64)
    for angle in pose[..., 2].T:
        known = np.isfinite(angle)
        angle[known] = np.unwrap(angle[known])
    return replace(recording, pose=pose)


def _reason(recording: Recording, properties: Properties) -> str:
    """Return why a recording cannot be used; empty if it can."""
    if recording.trouble:
        return recording.trouble
    problem = next(recording_problems(recording, properties), None)
    return problem.kind if problem else ""


def _array(values: list[Any]) -> np.ndarray:
    """Return numbers in double precision, NaN for None."""
    return np.array(values, np.float64)
