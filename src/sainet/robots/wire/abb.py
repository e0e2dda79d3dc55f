"""A physical robot: an arm that carries the pusher, and a tracker of the disks."""

from collections import deque
from collections.abc import Callable, Iterator
from itertools import chain

import jax.numpy as jnp
import numpy as np

from sainet.robots.base import AbstractRobot
from sainet.robots.wire.arm import AbstractArm, NoFeedback, Stroke
from sainet.robots.wire.cell import Cell
from sainet.robots.wire.clock import AbstractClock, RealClock
from sainet.robots.wire.disks import (
    REST,
    DiskTracker,
    Measurement,
    Poses,
    Watch,
    unrest,
)
from sainet.robots.wire.executed import Execution, disturbance, unexecuted
from sainet.robots.wire.limits import Stopped
from sainet.robots.wire.route import Path, Route, plan_route
from sainet.robots.wire.tracker import AbstractTracker
from sainet.runs.errors import BadInput, SainetError, unknown_name
from sainet.scenes.pushes import Push, check_push
from sainet.scenes.recording import Recording
from sainet.scenes.scene import Scene
from sainet.scenes.state import State, at_rest

PATIENCE = 5.0  # s, for the tracker to name the disks, and to measure them at rest
_POLL = 0.002  # s
_REST_TIME = 0.2  # s, of frames that are averaged
_ARRANGED = 0.010  # m, from where people were asked to put a disk
_MOST_REQUESTS = 3  # in a row


class NoPose(SainetError):
    """Disks that cannot be measured, or are not where they should be."""


class AbbRobot(AbstractRobot):
    """Pushes with a physical arm and observes with a tracker."""

    def __init__(
        self,
        cell: Cell,
        arm: AbstractArm,
        tracker: AbstractTracker,
        *,
        ask: Callable[[str], None],
        clock: AbstractClock | None = None,
    ) -> None:
        """Take over arm and tracker, which are closed with the robot.

        Args:
            cell: the configuration.
            arm: carries the pusher.
            tracker: of the disks.
            ask: shows a request to people and returns when they have met it.
            clock: of arm and tracker; by default the machine's monotonic clock.
        """
        self._cell, self._arm, self._tracker, self._ask = cell, arm, tracker, ask
        self._clock = clock or RealClock()
        to_table = cell.calibration.tracker_to_table
        self._disks = DiskTracker(tracker, cell.disks, to_table, cell.tracker)
        self._to_table = cell.calibration.table_to_robot.inverse
        self._scene = cell.scene
        self._observed: State | None = None  # since the last push

    def __exit__(self, *error: object) -> None:
        """Let go of arm and tracker."""
        self._arm.close()
        self._tracker.close()

    @property
    def scene(self) -> Scene:
        """The properties of the disks, as people measured them."""
        return self._scene

    @property
    def truth(self) -> State:
        """The last measured poses."""
        return self._observed or self.observe()

    def check_names(self) -> None:
        """Wait until the tracker has named every disk.

        Raises:
            BadInput: it names no such body, or none at all.
        """
        wanted, named = [disk.body for disk in self._cell.disks], self._disks.named
        for _ in self._listen():
            if named.issuperset(wanted):
                return
        if not named:
            raise BadInput(
                f"tracker: it named no body in {PATIENCE:g} s; check that it streams "
                "to the address and port of the configuration."
            )
        missing = next(name for name in wanted if name not in named)
        raise unknown_name("body of the tracker", missing, named)

    def observe(self) -> State:
        """Return the mean poses of some frames at rest.

        Raises:
            NoPose: the disks move, or frames cannot be used.
            NoFeedback: the arm cannot be measured.
        """
        pose = self._pose_at_rest()
        tip = self._to_table.moved(self._arm.position())
        place, angle = jnp.asarray(pose[:, :2]), jnp.asarray(pose[:, 2])
        self._observed = at_rest(place, angle, jnp.asarray(tip[:2]))
        return self._observed

    def arrange(self, state: State) -> None:
        """Ask people to put the disks at these poses, until their centres are there.

        Raises:
            NoPose: they are elsewhere after several requests.
        """
        poses = zip(
            self._cell.disks,
            np.asarray(state.position),
            np.asarray(state.angle),
            strict=True,
        )
        places = [
            f"'{disk.body}' at ({1000 * x:.0f}, {1000 * y:.0f}) mm, turned to "
            f"{np.rad2deg(angle) % 360:.0f} degrees"
            for disk, (x, y), angle in poses
        ]
        request = problem = f"Put {', '.join(places)}, and step back."
        for _ in range(_MOST_REQUESTS):
            self._ask(request)
            self._disks.forget(self._clock.now())
            try:
                found = np.asarray(self.observe().position)
                off = np.linalg.norm(found - np.asarray(state.position), axis=-1)
                if (off <= _ARRANGED).all():
                    return
                problem = f"a disk is {1000 * off.max():.0f} mm off its place"
            except NoPose as error:
                problem = str(error)
            request = f"{problem}: put {', '.join(places)}, and step back."
        raise NoPose(f"the disks were not arranged: {problem}.")

    def push(self, push: Push) -> Recording:
        """Push from the last observation, and hold until the disks rest.

        Returns:
            A recording with the samples of arm and tracker, each at its own times. If
            the push was refused or stopped before it, one sample: the last observation.
        """
        check_push(push)
        state, self._observed = self.truth, None
        try:
            route = self._route(state, push)
        except (Stopped, NoFeedback) as reason:
            return unexecuted(self._cell, state, push, str(reason))
        approach, found = self._follow(route.approach)
        trouble = approach.trouble or disturbance(self._cell.disks, state, found[-1:])
        if trouble:
            return unexecuted(self._cell, state, push, trouble)
        stroke, found = self._follow(route.straight)
        if not len(stroke.time):
            return unexecuted(self._cell, state, push, stroke.trouble)
        later = "" if stroke.trouble else self._follow(route.retreat)[0].trouble
        executed = Execution(self._cell, state, push, route, stroke, found)
        return executed.recording(self._arm.rehearsal or executed.problem or later)

    def _route(self, state: State, push: Push) -> Route:
        """Return the route of a push, or raise `Stopped` if a limit refuses it."""
        tip = self._arm.position()
        route = plan_route(self._cell, self._scene, tip, state, push)
        self._cell.limits.rows(tip, route.whole)
        return route

    def _follow(self, path: Path) -> tuple[Stroke, list[Measurement]]:
        """Follow a path while the disks are measured."""
        watch = Watch(self._disks, self._clock, self._cell.tracker.most_faulty_frames)
        return self._arm.follow(path, watch), watch.found

    def _listen(self) -> Iterator[list[Measurement]]:
        """Yield what is measured while there is patience."""
        self._disks.pause(self._clock.now())
        end = self._clock.now() + PATIENCE
        while self._clock.now() < end:
            self._clock.wait(_POLL)
            yield self._disks.measure()

    def _pose_at_rest(self) -> Poses:
        window = deque[Poses](maxlen=round(_REST_TIME * self._cell.tracker.rate_hz))
        reason = "the tracker gave no frame"
        for found in chain.from_iterable(self._listen()):
            if found.trouble:
                reason = found.trouble
                window.clear()
                continue
            window.append(found.pose)
            if len(window) == window.maxlen:
                moved = unrest(self._cell.disks, np.array(window))
                if moved <= REST:
                    return np.mean(window, axis=0)
                reason = f"a disk moves, by {1000 * moved:.2f} mm in {_REST_TIME:g} s"
        raise NoPose(f"the disks cannot be measured at rest: {reason}.")
