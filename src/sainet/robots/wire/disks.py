"""Poses of the disks on the table, from the frames of a tracker."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from sainet.robots.wire.cell import Disk, Tracking
from sainet.robots.wire.clock import AbstractClock
from sainet.robots.wire.frames import Rigid
from sainet.robots.wire.tracker import AbstractTracker, Frame

_NOISE = 1e-3  # m: of two frames, far above that of motion capture
_SAME_PLACE = 5e-3  # m: a disk that rested between two frames is closer
REST = 2e-4  # m, between mean poses, that disks at rest may move

Poses = Float[np.ndarray, "body 3"]  # m, m, rad, on the table


@dataclass(frozen=True)
class Measurement:
    """Poses of the disks on the table in one frame, or why it gives none."""

    number: int  # of the frame
    time: float  # s, on this computer's clock, when the frame was exposed
    pose: Poses  # NaN with a trouble
    trouble: str = ""


class _Refused(Exception):
    """The reason why a frame cannot be used."""


class DiskTracker:
    """Measures the disks on the table; no frame with a fault becomes a pose."""

    def __init__(
        self,
        tracker: AbstractTracker,
        disks: Sequence[Disk],
        to_table: Rigid,
        limits: Tracking,
    ) -> None:
        """Measure disks with a tracker.

        Args:
            tracker: gives frames.
            disks: to measure, in this order.
            to_table: from the tracker's frame.
            limits: to poses and frames.
        """
        self._tracker, self._disks = tracker, disks
        self._to_table, self._limits = to_table, limits
        self.named = set[str]()  # bodies in any frame
        self._last: Measurement | None = None  # the last usable one
        self._number: int | None = None  # of the newest frame
        self._raw = b""  # the poses of the last frame
        self._changed: float | None = None  # s, when they last changed
        self._usable = -np.inf  # s, when the last usable frame was exposed
        self._paused = True  # nobody measured since `_last`

    def measure(self) -> list[Measurement]:
        """Return what was measured since the last call, without waiting."""
        return [self._measured(frame) for frame in self._tracker.frames()]

    def pause(self, now: float) -> None:
        """Drop the frames that wait; disks and tracker may have moved since the last.

        Two disks may not have changed places, which is how exchanged names look.
        """
        self._tracker.discard()
        self._paused, self._number, self._changed = True, None, None
        self._usable = now

    def forget(self, now: float) -> None:
        """Pause; the disks may be anywhere now."""
        self.pause(now)
        self._last = None

    def silence(self, now: float) -> str:
        """Return the trouble if the last usable frame is too old, else nothing."""
        age = now - self._usable
        if age <= self._limits.largest_age_s + self._limits.latency_s:
            return ""
        return f"the tracker gave no usable frame for {1000 * age:.0f} ms"

    def _measured(self, frame: Frame) -> Measurement:
        time = frame.time - self._limits.latency_s
        try:
            pose = self._checked(frame)
        except _Refused as reason:
            unknown = np.full((len(self._disks), 3), np.nan)
            return Measurement(frame.number, time, unknown, f"tracker: {reason}")
        self._last, self._paused = Measurement(frame.number, time, pose), False
        self._usable = time
        return self._last

    def _checked(self, frame: Frame) -> Poses:
        """Return the poses on the table, or raise `_Refused`."""
        if frame.trouble:
            raise _Refused(frame.trouble)
        self.named |= set(frame.bodies)
        self._check_order(frame)
        bodies = [self._body(frame, disk) for disk in self._disks]
        self._check_fresh(frame, bodies)
        placed = [self._to_table.after(body) for body in bodies]
        for disk, body in zip(self._disks, placed, strict=True):
            self._check_on_table(disk, body)
        pose = np.array([[*body.shift[:2], body.turn] for body in placed])
        return self._continued(frame, pose)

    def _check_order(self, frame: Frame) -> None:
        last, self._number = self._number, max(frame.number, self._number or 0)
        if last is not None and frame.number <= last:
            came = "came twice" if frame.number == last else f"came after {last}"
            raise _Refused(f"frame {frame.number} {came}")

    def _body(self, frame: Frame, disk: Disk) -> Rigid:
        body = frame.bodies.get(disk.body)
        if body is None:
            raise _Refused(f"'{disk.body}' is not visible in frame {frame.number}")
        if not (np.isfinite(body.shift).all() and np.isfinite(body.rotation).all()):
            raise _Refused(f"the pose of '{disk.body}' holds NaN or infinity")
        return body

    def _check_fresh(self, frame: Frame, bodies: Sequence[Rigid]) -> None:
        raw = b"".join(
            body.shift.tobytes() + body.rotation.tobytes() for body in bodies
        )
        if raw != self._raw or self._changed is None:
            self._raw, self._changed = raw, frame.time
        age = frame.time - self._changed
        if age > self._limits.largest_age_s:
            raise _Refused(f"the same poses for {1000 * age:.0f} ms: it is frozen")

    def _check_on_table(self, disk: Disk, body: Rigid) -> None:
        tilt, most = np.rad2deg(body.tilt), self._limits.largest_tilt_deg
        if tilt > most:
            raise _Refused(
                f"'{disk.body}' is tilted by {tilt:.1f} degrees, more than {most:g}"
            )
        off = 1000 * float(body.shift[2]) - disk.height_mm
        if abs(off) > self._limits.largest_height_error_mm:
            raise _Refused(
                f"'{disk.body}' is {off:+.1f} mm off its height above the table"
            )

    def _continued(self, frame: Frame, pose: Poses) -> Poses:
        """Return the poses with angles that continue the last ones, not wrapped."""
        if self._last is None:
            return pose
        turn = pose[:, 2] - self._last.pose[:, 2]
        pose[:, 2] -= 2 * np.pi * np.round(turn / (2 * np.pi))
        rate, most = self._limits.rate_hz, self._limits.largest_age_s
        passed = 0.0 if self._paused else (frame.number - self._last.number) / rate
        speed = self._limits.largest_speed_mm_s / 1000
        # A damaged number does not excuse a jump: an older pose is not compared to.
        reach = speed * min(passed, most) + _NOISE
        self._check_names(pose, max(reach, _SAME_PLACE))
        if not self._paused:
            self._check_moved(pose, reach)
        return pose

    def _check_names(self, pose: Poses, reach: float) -> None:
        """Refuse disks that stand where others stood, and not where they stood."""
        assert self._last is not None
        offset = pose[:, None, :2] - self._last.pose[None, :, :2]
        near = np.linalg.norm(offset, axis=-1) <= reach  # now, before
        for one, other in np.argwhere(near & near.T):
            if one < other and not near[one, one]:
                names = f"'{self._disks[one].body}' and '{self._disks[other].body}'"
                raise _Refused(f"the names {names} are exchanged")

    def _check_moved(self, pose: Poses, reach: float) -> None:
        assert self._last is not None
        steps = moved(self._disks, self._last.pose, pose)
        for disk, step in zip(self._disks, steps, strict=True):
            if step > reach:
                raise _Refused(
                    f"'{disk.body}' jumped {1000 * step:.1f} mm between frames"
                )


def moved(
    disks: Sequence[Disk], before: Poses, after: Poses
) -> Float[np.ndarray, " body"]:
    """Return how far disks moved (m), or their rims if those moved further."""
    step = after - before
    radius = np.array([disk.radius_mm for disk in disks]) / 1000
    way = np.linalg.norm(step[:, :2], axis=-1)
    return np.maximum(way, radius * np.abs(step[:, 2]))


def unrest(disks: Sequence[Disk], poses: Float[np.ndarray, "time body 3"]) -> float:
    """Return how far a disk moved (m) between the mean poses of both halves."""
    half = max(len(poses) // 2, 1)
    early, late = poses[:half].mean(axis=0), poses[-half:].mean(axis=0)
    return float(moved(disks, early, late).max())


class Watch:
    """Measures the disks during a motion, and finds the reason to stop it."""

    def __init__(
        self, disks: DiskTracker, clock: AbstractClock, tolerated: int
    ) -> None:
        """Watch from the first call on.

        Args:
            disks: to measure.
            clock: of the measurements.
            tolerated: faulty frames in a row that do not stop the motion.
        """
        self._disks, self._clock, self._tolerated = disks, clock, tolerated
        self._faulty: int | None = None
        self.found: list[Measurement] = []  # usable ones

    def __call__(self) -> str:
        """Return why the motion has to stop, or nothing."""
        if self._faulty is None:
            self._disks.pause(self._clock.now())
            self._faulty = 0
        for measurement in self._disks.measure():
            self._faulty = self._faulty + 1 if measurement.trouble else 0
            if self._faulty > self._tolerated:
                return measurement.trouble
            if not measurement.trouble:
                self.found.append(measurement)
        return self._disks.silence(self._clock.now())
