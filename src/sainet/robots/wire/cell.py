"""The configuration of a cell: robot, tracker, disks, limits and calibration.

Names of fields carry their unit. Every field is checked when the file is read: before
anything listens, sends or moves.
"""

from ipaddress import IPv4Address
from pathlib import Path
from typing import Annotated, Literal

import msgspec
import numpy as np
from jaxtyping import Float

from sainet.robots.wire.frames import Rigid, fit_rigid, residuals
from sainet.robots.wire.limits import FEEDBACK_AGE, LAG, LINE_LIMIT, SPEED_LIMIT, Limits
from sainet.robots.wire.transport import LARGEST_PORT, LOOPBACK
from sainet.runs.documents import content_hash, read_document
from sainet.scenes.quantities import FRICTION, MASS, PUSHER_RADIUS, RADIUS
from sainet.scenes.scene import Scene

_FEWEST_POINTS = 4  # with three, an error in height leaves no residual
_REMEDY = "compare with examples/cell.toml"

Name = Annotated[str, msgspec.Meta(min_length=1, max_length=100)]
Port = Annotated[int, msgspec.Meta(ge=1, le=LARGEST_PORT)]
Count = Annotated[int, msgspec.Meta(ge=0, le=1000)]
Place = Annotated[float, msgspec.Meta(ge=-1e5, le=1e5)]  # mm
Length = Annotated[float, msgspec.Meta(ge=0.01, le=1e4)]  # mm
Speed = Annotated[float, msgspec.Meta(ge=0.1, le=2000.0)]  # mm/s
Seconds = Annotated[float, msgspec.Meta(ge=0.0, le=60.0)]
Rate = Annotated[float, msgspec.Meta(ge=10.0, le=2000.0)]  # Hz
Tilt = Annotated[float, msgspec.Meta(ge=0.1, le=45.0)]  # deg
Range = tuple[Place, Place]
Position = tuple[Place, Place, Place]


class _Section(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A section of the file; unknown fields are refused."""


class _Peer(_Section, frozen=True, kw_only=True):
    """Where a device is, and where this computer listens for it."""

    host: str = LOOPBACK  # address of the device; a packet of another one stops a push
    listen: str = LOOPBACK  # address of this computer

    def __post_init__(self) -> None:
        """Check the addresses."""
        for name in ("host", "listen"):
            value = getattr(self, name)
            try:
                unusable = IPv4Address(value).is_unspecified
            except ValueError:
                unusable = True
            if unusable:
                raise ValueError(f"{name} is '{value}'; it must be one IPv4 address")


class Controller(_Peer, frozen=True, kw_only=True):
    """The controller of the robot."""

    port: Port = 6510  # at which this computer listens


class Tracking(_Peer, frozen=True, kw_only=True):
    """The tracker, and what it may report."""

    kind: Literal["vicon-stream", "vicon", "optitrack", "qualisys", "vrpn", "mock"]
    port: Port = 51001  # at which this computer listens (vicon-stream)
    rate_hz: Rate  # frames per second
    latency_s: Seconds = 0.0  # from the exposure of a frame to its arrival
    largest_age_s: Seconds  # of the last usable frame while the robot moves
    most_faulty_frames: Count = 0  # in a row, skipped while the robot moves
    largest_speed_mm_s: Speed  # of a disk: what is faster is a jump
    largest_tilt_deg: Tilt  # of a disk on the table
    largest_height_error_mm: Length  # of a disk on the table


class Disk(_Section, frozen=True, kw_only=True):
    """A disk; the first one is pushed."""

    body: Name  # of the tracker
    mass_kg: Annotated[float, MASS.meta]
    radius_mm: Annotated[float, RADIUS.times(1000, "mm").meta]
    height_mm: Place  # of the body's origin above the table


class Pusher(_Section, frozen=True, kw_only=True):
    """The pusher, a vertical cylinder, and its heights above the table."""

    radius_mm: Annotated[float, PUSHER_RADIUS.times(1000, "mm").meta]
    push_height_mm: Length  # of the tip during a push
    travel_height_mm: Length  # of the tip above all disks
    clearance_mm: Length  # to every disk where the pusher descends

    def __post_init__(self) -> None:
        """Check the order of the heights."""
        if not self.push_height_mm < self.travel_height_mm:
            raise ValueError("push_height_mm must be below travel_height_mm")


class Motion(_Section, frozen=True, kw_only=True):
    """Speeds of the pusher and limits of the motion."""

    largest_speed_mm_s: Annotated[float, SPEED_LIMIT.times(1000, "mm/s").meta]
    travel_speed_mm_s: Annotated[float, SPEED_LIMIT.times(1000, "mm/s").meta]
    hold_s: Seconds  # at the end of a push, until the disks rest
    largest_deviation_mm: Annotated[float, LINE_LIMIT.times(1000, "mm").meta]
    largest_lag_s: Annotated[float, LAG.meta]  # of the arm behind its commands
    largest_age_cycles: Annotated[float, FEEDBACK_AGE.meta]  # of feedback

    def __post_init__(self) -> None:
        """Check the order of the speeds."""
        if self.travel_speed_mm_s > self.largest_speed_mm_s:
            raise ValueError("travel_speed_mm_s must not exceed largest_speed_mm_s")


class Workspace(_Section, frozen=True, kw_only=True):
    """Where the tip of the pusher may be, in the frame of the robot's base."""

    x_mm: Range
    y_mm: Range
    z_mm: Range

    def __post_init__(self) -> None:
        """Check that no range is empty."""
        for name in self.__struct_fields__:
            low, high = getattr(self, name)
            if not low < high:
                raise ValueError(
                    f"{name} is [{low:g}, {high:g}]; the lower limit comes first"
                )


class Point(_Section, frozen=True, kw_only=True):
    """One point of the table, measured in all frames."""

    name: Name
    table_mm: Position
    robot_mm: Position
    tracker_mm: Position


class Calibration(_Section, frozen=True, kw_only=True):
    """Points that relate the frames of table, robot base and tracker."""

    largest_residual_mm: Length
    points: Annotated[list[Point], msgspec.Meta(min_length=_FEWEST_POINTS)]

    def __post_init__(self) -> None:
        """Check both transforms."""
        for source, target in (("table", "robot"), ("tracker", "table")):
            self._check(source, target)

    @property
    def table_to_robot(self) -> Rigid:
        """The transform from the table to the robot's base."""
        return self._fit("table", "robot")

    @property
    def tracker_to_table(self) -> Rigid:
        """The transform from the tracker to the table."""
        return self._fit("tracker", "table")

    def _fit(self, source: str, target: str) -> Rigid:
        found = fit_rigid(self._measured(source), self._measured(target))
        if found is None:
            raise ValueError(f"the points lie on a line in the {source} frame")
        return found

    def _check(self, source: str, target: str) -> None:
        moved = self._fit(source, target)
        left = residuals(moved, self._measured(source), self._measured(target)) * 1000
        worst = int(np.argmax(left))
        if left[worst] > self.largest_residual_mm:
            raise ValueError(
                f"from {source} to {target} a residual of {left[worst]:.3g} mm remains "
                f"at point '{self.points[worst].name}', more than largest_residual_mm "
                f"{self.largest_residual_mm:g}; measure the points again"
            )

    def _measured(self, frame: str) -> Float[np.ndarray, "point 3"]:
        return np.array([getattr(p, f"{frame}_mm") for p in self.points], float) / 1000


class Frictions(_Section, frozen=True, kw_only=True):
    """Friction coefficients."""

    table: Annotated[float, FRICTION.meta] = 0.15
    disk: Annotated[float, FRICTION.meta] = 0.25
    pusher: Annotated[float, FRICTION.meta] = 0.25


class Cell(_Section, frozen=True, kw_only=True):
    """The configuration of a cell."""

    surface: str = ""  # material of the table
    controller: Controller
    tracker: Tracking
    disks: Annotated[list[Disk], msgspec.Meta(min_length=1, max_length=10)]
    pusher: Pusher
    frictions: Frictions = Frictions()
    motion: Motion
    workspace: Workspace
    calibration: Calibration

    def __post_init__(self) -> None:
        """Check the names of the bodies."""
        if len({disk.body for disk in self.disks}) < len(self.disks):
            raise ValueError("two disks have the same body")

    @property
    def digest(self) -> str:
        """The hash of what recordings depend on, not of how the arm is reached."""
        pusher = self.pusher.radius_mm, self.pusher.push_height_mm
        places = self.calibration.points
        parts = self.surface, self.disks, pusher, self.frictions, places
        return content_hash(msgspec.json.encode(parts))

    @property
    def limits(self) -> Limits:
        """The limits of the arm."""
        place, motion = self.workspace, self.motion
        low, high = zip(place.x_mm, place.y_mm, place.z_mm, strict=True)
        return Limits(
            low=_metres(low),
            high=_metres(high),
            speed=motion.largest_speed_mm_s / 1000,
            line=motion.largest_deviation_mm / 1000,
            lag=motion.largest_lag_s,
            age=motion.largest_age_cycles,
        )

    @property
    def scene(self) -> Scene:
        """The measured properties of disks and pusher."""
        return Scene.disks(
            mass=[disk.mass_kg for disk in self.disks],
            radius=[disk.radius_mm / 1000 for disk in self.disks],
            table_friction=self.frictions.table,
            disk_friction=self.frictions.disk,
            pusher_friction=self.frictions.pusher,
            pusher_radius=self.pusher.radius_mm / 1000,
        )


def _metres(place: Position) -> Position:
    x, y, z = place
    return x / 1000, y / 1000, z / 1000


def read_cell(path: Path) -> Cell:
    """Return the checked configuration of a cell.

    Raises:
        BadInput: in one line with file, field and remedy.
    """
    return read_document(path, Cell, decode=msgspec.toml.decode, remedy=_REMEDY)
