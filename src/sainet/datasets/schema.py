"""The arrays and files of a dataset: dimensions, units, meaning and range of each."""

from dataclasses import dataclass
from functools import partial
from typing import Annotated

import msgspec
import numpy as np

from sainet.engines import RECORDED
from sainet.scenes.quantities import (
    ANGLE,
    DAMPING,
    FORCE,
    MOST_DISKS,
    MOST_PUSHES,
    MOST_STEPS,
    POSITION,
    PROPERTIES,
    PUSHER_MASS,
    SPIN,
    VELOCITY,
    Quantity,
    TimeStep,
)
from sainet.worlds.config import SetupName

Arrays = dict[str, np.ndarray]  # of some pushes, by the names of variables

FORMAT_VERSION = 2
ARRAYS = "pushes.zarr"  # folder of the arrays
HASHES = "hashes.json"
Hashes = dict[str, str]  # SHA-256 by file, relative to the folder of the arrays

# Part of a file name: of an engine or a model.
_Name = Annotated[
    str, msgspec.Meta(pattern=r"^[A-Za-z0-9][A-Za-z0-9_.+-]*$", max_length=100)
]
_Group = Annotated[str, msgspec.Meta(min_length=1, max_length=200)]


def _count(high: int) -> msgspec.Meta:
    return msgspec.Meta(ge=1, le=high)


class Listing(msgspec.Struct, frozen=True, kw_only=True):
    """Hashes of the files of a dataset; written last, so it marks a whole dataset."""

    files: Hashes
    format_version: int = FORMAT_VERSION


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

    def chunk_length(self, index: int) -> int:
        """Return the number of pushes of one chunk."""
        part = self.chunk_slice(index)
        return part.stop - part.start

    def push_names(self, part: slice) -> list[str]:
        """Return the names of some pushes in messages."""
        return [f"push {row} of the dataset" for row in range(part.start, part.stop)]


@dataclass(frozen=True)
class Variable:
    """One stored array; its first dimension is always `push`."""

    dimensions: tuple[str, ...]
    meaning: str
    # Of the values; of each column of the last dimension, if there are several.
    quantities: tuple[Quantity, ...] = ()
    dtype: type = np.float32
    is_input: bool = True  # of `batch.to_batch`, whatever the model
    is_hashed: bool = False  # part of what makes a push the same in every dataset

    @property
    def units(self) -> str:
        """The unit of the values, or of each column."""
        return " ".join(each.unit or "1" for each in self.quantities) or "1"

    def shape(self, info: StoreInfo) -> tuple[int, ...]:
        """Return the shape of the whole array."""
        lengths = {"push": info.pushes, "time": info.steps, "body": info.bodies}
        lengths |= {"motion": 6, "pose": 3, "xy": 2}
        return tuple(lengths[dimension] for dimension in self.dimensions)

    def chunk_shape(self, info: StoreInfo) -> tuple[int, ...]:
        """Return the shape of the chunks of the array."""
        return (min(info.chunk_size, info.pushes), *self.shape(info)[1:])


_hashed = partial(Variable, is_hashed=True)
_requested = partial(Variable, is_input=False)
_POSE_QUANTITIES = (POSITION, POSITION, ANGLE)
_MOTION_QUANTITIES = (*_POSE_QUANTITIES, VELOCITY, VELOCITY, SPIN)
_PUSH = ("push",)
_BODY = ("push", "body")
_STEP = ("push", "time")
_POSE, _MOTION = (*_BODY, "pose"), (*_BODY, "motion")
_POSES, _MOTIONS = (*_STEP, "body", "pose"), (*_STEP, "body", "motion")
_XY, _PATH = ("push", "xy"), (*_STEP, "xy")
_MEANINGS = {
    "mass": "mass of a disk",
    "radius": "radius of a disk",
    "table_friction": "friction between disks and table",
    "disk_friction": "friction between two disks",
    "pusher_friction": "friction of pusher and disk",
    "pusher_radius": "radius of the pusher",
}

_ALWAYS = {
    name: Variable(
        _BODY if name in ("mass", "radius") else _PUSH, _MEANINGS[name], (quantity,)
    )
    for name, quantity in PROPERTIES.items()
} | {
    "steps": _hashed(_PUSH, "number of steps of the push", dtype=np.int32),
    "group": _requested(_PUSH, "index into the attribute groups", dtype=np.int32),
    "initial": _hashed(_MOTION, "state before the push", _MOTION_QUANTITIES),
    "initial_pusher": _hashed(_XY, "pusher before the push", (POSITION,)),
    "truth": Variable(_MOTIONS, "true state after each step", _MOTION_QUANTITIES),
    "truth_pusher": _requested(_PATH, "true pusher after each step", (POSITION,)),
    "pose_observed": Variable(_STEP, "1 where the pose is known", dtype=np.uint8),
    "rate_observed": Variable(
        _STEP, "1 where the velocities are known", dtype=np.uint8
    ),
}

# Arrays of the controls, by the names that `scenes.controls` gives them.
_COMMANDS: dict[SetupName, dict[str, Variable]] = {
    "robot": {
        "command_position": _hashed(
            _PATH, "commanded pusher after each step", (POSITION,)
        ),
        "command_velocity": Variable(
            _PATH, "commanded velocity during each step", (VELOCITY,)
        ),
    },
    "direct-force": {
        "force": _hashed(
            _PATH, "commanded force on the pusher during each step", (FORCE,)
        ),
        "contact_offset": _hashed(_XY, "pusher minus disk 1 at the start", (POSITION,)),
    },
}


def variables(info: StoreInfo) -> dict[str, Variable]:
    """Return every array of such a store by its name."""
    found = _ALWAYS | _COMMANDS[info.kind]
    if info.has_measurements:
        found["measured"] = Variable(
            _POSES, "pose as it was captured", _POSE_QUANTITIES
        )
    if info.has_repeats:
        meaning = "pushes that were meant to be alike share it"
        found["repeat"] = _requested(_PUSH, meaning, dtype=np.int32)
    for engine in info.assumed_engines:
        meaning = f"s-bar: prediction of {engine}, assumed properties"
        found[simulated_name(engine)] = _requested(
            _MOTIONS, meaning, _MOTION_QUANTITIES
        )
    for model in info.published:
        meaning = f"final pose as published: {model}"
        found[published_name(model)] = _requested(_POSE, meaning, _POSE_QUANTITIES)
    return found


def input_names(info: StoreInfo) -> tuple[str, ...]:
    """Return the arrays of every batch; simulator predictions come on request."""
    return tuple(name for name, each in variables(info).items() if each.is_input)


def simulated_name(engine: str) -> str:
    """Return the name of the array that holds an assumed engine's prediction."""
    return "simulated_" + engine


def published_name(model: str) -> str:
    """Return the name of the array that holds a published model's prediction."""
    return "published_" + model


def chunk_file(name: str, variable: Variable, index: int) -> str:
    """Return the file of one chunk of an array, in the folder of the arrays."""
    return "/".join([name, "c", str(index), *["0"] * (len(variable.dimensions) - 1)])
