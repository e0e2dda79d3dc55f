"""Recordings of executed pushes: the samples of arm and tracker on one clock."""

from collections.abc import Sequence
from dataclasses import dataclass

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from sainet.robots.wire.arm import Stroke
from sainet.robots.wire.cell import Cell, Disk
from sainet.robots.wire.disks import REST, Measurement, moved, unrest
from sainet.robots.wire.route import Route
from sainet.scenes.pushes import Push
from sainet.scenes.recording import Conditions, Recording
from sainet.scenes.state import State, poses_of

_STILL = 5e-4  # m, that a disk moves which was not pushed
_DISTURBED = 2e-3  # m, that a disk moved before the push
_REST_TIME = 0.1  # s, at the end, in which the disks rest
_FEWEST = 10  # frames from which the tracker's clock is estimated


@dataclass(frozen=True)
class Execution:
    """The straight motion of a push, as arm and tracker measured it.

    The stroke has at least one sample.
    """

    cell: Cell
    state: State  # observed before
    push: Push  # as wanted
    route: Route
    stroke: Stroke
    found: Sequence[Measurement]

    @property
    def problem(self) -> str:
        """Why the push differs from the wanted one; empty: it does not."""
        if self.stroke.trouble:
            return self.stroke.trouble
        if not self.found:
            return "the tracker measured nothing during the push"
        disks, poses = self.cell.disks, np.array([each.pose for each in self.found])
        if reason := disturbance(disks, self.state, self.found[:1]):
            return reason
        last = max(round(_REST_TIME * self.cell.tracker.rate_hz), 2)
        if unrest(disks, poses[-last:]) > REST:
            return "the disks did not come to rest; lengthen motion.hold_s"
        if moved(disks, poses[0], poses[-1])[0] < _STILL:
            return "disk 1 did not move"
        return ""

    def recording(self, trouble: str) -> Recording:
        """Return the samples of arm and tracker, each at its own times.

        Args:
            trouble: why the push differs from the wanted one.
        """
        exposed = tracker_times(self.found)
        time = np.union1d(self.stroke.time, exposed)
        pose = np.full((len(time), len(self.cell.disks), 3), np.nan)
        pusher = np.full((len(time), 2), np.nan)
        for row, each in zip(np.searchsorted(time, exposed), self.found, strict=True):
            pose[row] = each.pose
        rows = np.searchsorted(time, self.stroke.time)
        pusher[rows] = self._on_table(self.stroke.measured)
        return Recording(
            time=time - time[0],
            pose=pose,
            pusher=pusher,
            commanded=self._commanded(),
            conditions=_conditions(self.cell, self.push),
            trouble=trouble,
        )

    def _on_table(
        self, places: Float[np.ndarray, "sample 3"]
    ) -> Float[np.ndarray, "sample 2"]:
        return self.cell.calibration.table_to_robot.inverse.moved(places)[:, :2]

    def _commanded(self) -> Push | None:
        """Return the push as far as it was commanded; None: not up to the contact."""
        end = self._on_table(self.stroke.commanded[-1:])[0]
        length = float((end - self.route.contact) @ self.route.heading)
        if length <= 0:
            return None
        if length > float(self.push.length) - 1e-6:  # m: rounding
            return self.push
        return eqx.tree_at(lambda push: push.length, self.push, jnp.float32(length))


def unexecuted(cell: Cell, state: State, push: Push, trouble: str) -> Recording:
    """Return the recording of a push that was not executed: the last observation."""
    return Recording(
        time=np.zeros(1),
        pose=poses_of(state)[None],
        pusher=np.asarray(state.pusher_position, float)[None],
        conditions=_conditions(cell, push),
        trouble=trouble,
    )


def disturbance(
    disks: Sequence[Disk], state: State, found: Sequence[Measurement]
) -> str:
    """Return which disk moved since it was observed, by the first measurement."""
    for measurement in found[:1]:
        steps = moved(disks, poses_of(state), measurement.pose)
        far = int(np.argmax(steps))
        if steps[far] > _DISTURBED:
            step = 1000 * steps[far]
            return f"'{disks[far].body}' moved {step:.1f} mm before the push"
    return ""


def tracker_times(found: Sequence[Measurement]) -> Float[np.ndarray, " frame"]:
    """Return the times (s) of frames, on this computer's clock.

    Frames are exposed at a constant rate and arrive with varying delays: the times are
    a line through the arrivals, by the number of the frame.
    """
    number = np.array([each.number for each in found], float)
    time = np.array([each.time for each in found])
    if len(found) < _FEWEST:
        return time
    slope, start = np.polyfit(number - number[0], time - time[0], 1)
    return time[0] + start + slope * (number - number[0])


def _conditions(cell: Cell, push: Push) -> Conditions:
    return Conditions(surface=cell.surface, speed_mm_s=1000 * float(push.speed))
