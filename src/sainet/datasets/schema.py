"""What a store holds: every array with its dimensions, units and meaning."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

Arrays = dict[str, np.ndarray]  # of some pushes, by the names of variables

FORMAT_VERSION = 1
RECORDED = "recorded"  # in the place of the engine that made the truth
MOTION = ("x", "y", "angle", "velocity_x", "velocity_y", "spin")
MOTION_UNITS = "m m rad m/s m/s rad/s"

Kind = Literal["robot", "direct-force"]


@dataclass(frozen=True)
class StoreInfo:
    """What a whole store has in common; kept as its attributes."""

    kind: Kind
    pushes: int
    bodies: int
    steps: int  # of the longest push
    chunk_size: int  # pushes
    time_step: float  # s
    engine: str  # that made the truth, or "recorded"
    assumed_engines: tuple[str, ...] = ()  # whose s-bar is kept
    has_measurements: bool = False  # apart from the truth
    groups: tuple[str, ...] = ()  # names of the codes in `group`
    published: tuple[str, ...] = ()  # models whose published predictions are kept
    has_repeats: bool = False  # known which pushes were meant to be alike
    seed: int | None = None
    pusher_mass: float = 10.0  # kg (direct force)
    damping: float = 1000.0  # N s/m (direct force)

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
    dtype: type = np.float32


_BODY = ("push", "body")
_MOTION = ("push", "time", "body", "motion")
_PATH = ("push", "time", "xy")

_ALWAYS = {
    "mass": Variable(_BODY, "kg", "mass of a disk"),
    "radius": Variable(_BODY, "m", "radius of a disk"),
    "table_friction": Variable(("push",), "1", "friction between disks and table"),
    "disk_friction": Variable(("push",), "1", "friction between two disks"),
    "pusher_friction": Variable(("push",), "1", "friction of pusher and disk"),
    "pusher_radius": Variable(("push",), "m", "radius of the pusher"),
    "steps": Variable(("push",), "1", "number of steps of the push", np.int32),
    "group": Variable(("push",), "1", "index into the attribute groups", np.int32),
    "initial": Variable(
        ("push", "body", "motion"), MOTION_UNITS, "state before the push"
    ),
    "initial_pusher": Variable(("push", "xy"), "m", "pusher before the push"),
    "truth": Variable(_MOTION, MOTION_UNITS, "true state after each step"),
    "truth_pusher": Variable(_PATH, "m", "true pusher after each step"),
    "pose_observed": Variable(
        ("push", "time"), "1", "1 where the pose is known", np.uint8
    ),
    "rate_observed": Variable(
        ("push", "time"), "1", "1 where the velocities are known", np.uint8
    ),
}

_ROBOT = {
    "command_position": Variable(_PATH, "m", "commanded pusher after each step"),
    "command_velocity": Variable(_PATH, "m/s", "commanded velocity during each step"),
}

_FORCE = {
    "force": Variable(_PATH, "N", "commanded force on the pusher during each step"),
    "contact_offset": Variable(("push", "xy"), "m", "pusher minus disk 1 at the start"),
}


def variables(info: StoreInfo) -> dict[str, Variable]:
    """Return every array of such a store by its name."""
    found = dict(_ALWAYS)
    found |= _ROBOT if info.kind == "robot" else _FORCE
    if info.has_measurements:
        found["measured"] = Variable(
            ("push", "time", "body", "pose"), "m m rad", "pose as it was captured"
        )
    if info.has_repeats:
        found["repeat"] = Variable(
            ("push",), "1", "pushes that were meant to be alike share it", np.int32
        )
    for engine in info.assumed_engines:
        found[simulated_name(engine)] = Variable(
            _MOTION, MOTION_UNITS, f"s-bar: prediction of {engine}, assumed properties"
        )
    for model in info.published:
        found[published_name(model)] = Variable(
            ("push", "body", "pose"), "m m rad", f"final pose as published: {model}"
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
