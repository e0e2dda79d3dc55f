"""The arrays of a dataset: dimensions, units, meaning and range of each."""

from dataclasses import dataclass
from typing import Annotated

import msgspec
import numpy as np

from sainet.scenes.quantities import (
    ANGLE,
    DAMPING,
    FORCE,
    FRICTION,
    MASS,
    MOST_DISKS,
    MOST_PUSHES,
    MOST_STEPS,
    POSITION,
    PUSHER_MASS,
    PUSHER_RADIUS,
    RADIUS,
    SPIN,
    VELOCITY,
    Quantity,
    TimeStep,
)
from sainet.worlds.config import SetupName

Arrays = dict[str, np.ndarray]  # of some pushes, by the names of variables

FORMAT_VERSION = 2
RECORDED = "recorded"  # instead of the engine that made the ground truth
MOTION_UNITS = "m m rad m/s m/s rad/s"

# Part of a file name: of an engine or a model.
_Name = Annotated[
    str, msgspec.Meta(pattern=r"^[A-Za-z0-9][A-Za-z0-9_.+-]*$", max_length=100)
]
_Group = Annotated[str, msgspec.Meta(min_length=1, max_length=200)]


def _count(high: int) -> msgspec.Meta:
    return msgspec.Meta(ge=1, le=high)


class StoreInfo(msgspec.Struct, frozen=True, kw_only=True):
    """Properties that all pushes of a dataset share; stored as its attributes."""

    kind: SetupName
    pushes: Annotated[int, _count(MOST_PUSHES)]
    bodies: Annotated[int, _count(MOST_DISKS)]
    steps: Annotated[int, _count(MOST_STEPS)]  # of the longest push
    chunk_size: Annotated[int, _count(MOST_PUSHES)]  # pushes
    time_step: TimeStep  # s
    engine: _Name  # that made the ground truth, or "recorded"
    assumed_engines: tuple[_Name, ...] = ()  # with stored simulator predictions
    has_measurements: bool = False  # apart from the ground truth
    groups: tuple[_Group, ...] = ()  # names of the codes in `group`
    published: tuple[_Name, ...] = ()  # models with stored published predictions
    has_repeats: bool = False  # whether `repeat` numbers equal plans
    seed: Annotated[int, msgspec.Meta(ge=0)] | None = None
    pusher_mass: Annotated[float, PUSHER_MASS.meta] = 10.0  # kg (direct force)
    damping: Annotated[float, DAMPING.meta] = 1000.0  # N s/m (direct force)
    format_version: int = FORMAT_VERSION

    @property
    def is_recorded(self) -> bool:
        """Whether the pushes were recorded, not simulated."""
        return self.engine == RECORDED

    @property
    def chunks(self) -> int:
        """The number of chunks along the pushes."""
        return -(-self.pushes // self.chunk_size)

    def chunk_slice(self, index: int) -> slice:
        """Return the pushes of one chunk."""
        start = index * self.chunk_size
        return slice(start, min(start + self.chunk_size, self.pushes))


@dataclass(frozen=True)
class Variable:
    """One stored array; its first dimension is always `push`."""

    dimensions: tuple[str, ...]
    units: str
    meaning: str
    # Of the values; of each column of the last dimension, if there are several.
    quantities: tuple[Quantity, ...] = ()
    dtype: type = np.float32


_POSE_QUANTITIES = (POSITION, POSITION, ANGLE)
_MOTION_QUANTITIES = (*_POSE_QUANTITIES, VELOCITY, VELOCITY, SPIN)
_PUSH = ("push",)
_BODY = ("push", "body")
_MOTION = ("push", "time", "body", "motion")
_PATH = ("push", "time", "xy")

_ALWAYS = {
    "mass": Variable(_BODY, "kg", "mass of a disk", (MASS,)),
    "radius": Variable(_BODY, "m", "radius of a disk", (RADIUS,)),
    "table_friction": Variable(
        _PUSH, "1", "friction between disks and table", (FRICTION,)
    ),
    "disk_friction": Variable(_PUSH, "1", "friction between two disks", (FRICTION,)),
    "pusher_friction": Variable(_PUSH, "1", "friction of pusher and disk", (FRICTION,)),
    "pusher_radius": Variable(_PUSH, "m", "radius of the pusher", (PUSHER_RADIUS,)),
    "steps": Variable(_PUSH, "1", "number of steps of the push", dtype=np.int32),
    "group": Variable(_PUSH, "1", "index into the attribute groups", dtype=np.int32),
    "initial": Variable(
        ("push", "body", "motion"),
        MOTION_UNITS,
        "state before the push",
        _MOTION_QUANTITIES,
    ),
    "initial_pusher": Variable(
        ("push", "xy"), "m", "pusher before the push", (POSITION,)
    ),
    "truth": Variable(
        _MOTION,
        MOTION_UNITS,
        "true state after each step",
        _MOTION_QUANTITIES,
    ),
    "truth_pusher": Variable(_PATH, "m", "true pusher after each step", (POSITION,)),
    "pose_observed": Variable(
        ("push", "time"), "1", "1 where the pose is known", dtype=np.uint8
    ),
    "rate_observed": Variable(
        ("push", "time"), "1", "1 where the velocities are known", dtype=np.uint8
    ),
}

_COMMANDS: dict[SetupName, dict[str, Variable]] = {
    "robot": {
        "command_position": Variable(
            _PATH, "m", "commanded pusher after each step", (POSITION,)
        ),
        "command_velocity": Variable(
            _PATH, "m/s", "commanded velocity during each step", (VELOCITY,)
        ),
    },
    "direct-force": {
        "force": Variable(
            _PATH,
            "N",
            "commanded force on the pusher during each step",
            (FORCE,),
        ),
        "contact_offset": Variable(
            ("push", "xy"), "m", "pusher minus disk 1 at the start", (POSITION,)
        ),
    },
}


def chunk_shape(info: StoreInfo, variable: Variable) -> tuple[int, ...]:
    """Return the shape of the chunks of an array."""
    lengths = tuple(sizes(info)[d] for d in variable.dimensions)
    return (min(info.chunk_size, info.pushes), *lengths[1:])


def variables(info: StoreInfo) -> dict[str, Variable]:
    """Return every array of such a store by its name."""
    found = _ALWAYS | _COMMANDS[info.kind]
    if info.has_measurements:
        found["measured"] = Variable(
            ("push", "time", "body", "pose"),
            "m m rad",
            "pose as it was captured",
            _POSE_QUANTITIES,
        )
    if info.has_repeats:
        found["repeat"] = Variable(
            ("push",),
            "1",
            "pushes that were meant to be alike share it",
            dtype=np.int32,
        )
    for engine in info.assumed_engines:
        found[simulated_name(engine)] = Variable(
            _MOTION,
            MOTION_UNITS,
            f"s-bar: prediction of {engine}, assumed properties",
            _MOTION_QUANTITIES,
        )
    for model in info.published:
        found[published_name(model)] = Variable(
            ("push", "body", "pose"),
            "m m rad",
            f"final pose as published: {model}",
            _POSE_QUANTITIES,
        )
    return found


def simulated_name(engine: str) -> str:
    """Return the name of the array that holds an assumed engine's prediction."""
    return "simulated_" + engine


def published_name(model: str) -> str:
    """Return the name of the array that holds a published model's prediction."""
    return "published_" + model


def sizes(info: StoreInfo) -> dict[str, int]:
    """Return the length of every dimension."""
    return {
        "push": info.pushes,
        "time": info.steps,
        "body": info.bodies,
        "motion": 6,
        "pose": 3,
        "xy": 2,
    }
