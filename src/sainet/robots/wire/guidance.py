"""The arm that is moved by ABB's Externally Guided Motion (EGM)."""

from collections.abc import Callable, Iterator
from typing import final

import numpy as np
from jaxtyping import Float

from sainet.robots.wire.arm import AbstractArm, NoFeedback, Sample, Stroke, unwatched
from sainet.robots.wire.clock import AbstractClock, RealClock
from sainet.robots.wire.egm import Feedback, Quaternion, decode_feedback, encode_command
from sainet.robots.wire.limits import CYCLE, Limits, Stopped
from sainet.robots.wire.transport import AbstractTransport
from sainet.robots.wire.watchdog import Idle, Watchdog
from sainet.runs.documents import checked

PATIENCE = 5.0  # s, for a controller to become ready; RAPID programs wait and restart
_READY = 10  # messages in a row, good and at one place, before a motion starts
_REST = 1e-4  # m, that an arm at rest may move meanwhile
_MOST_AT_ONCE = 100  # messages that wait at once


@final
class EgmArm(AbstractArm):
    """An arm that is moved by EGM position guidance.

    The controller sends a message every cycle, and each is answered with one position.
    When the watchdog finds fault with a message, or none arrives in time, nothing is
    answered any more: in position guidance the controller then goes to the last
    commanded position, which was inside every limit, and holds it, until its own
    `CommTimeout` ends the session. To answer with the measured position instead would
    trust feedback that was just found faulty, and would pull the arm back by its lag.
    """

    def __init__(
        self,
        transport: AbstractTransport,
        limits: Limits,
        clock: AbstractClock | None = None,
    ) -> None:
        """Take over the transport; closing the arm closes it.

        Args:
            transport: to the controller.
            limits: of the robot.
            clock: of the samples; by default the machine's monotonic clock.

        Raises:
            BadInput: a limit is out of range.
        """
        self._limits = checked(limits, "limits")
        self._transport = transport
        self._clock = clock or RealClock()
        self._sent = 0

    def close(self) -> None:
        """Stop listening."""
        self._transport.close()

    def position(self) -> Float[np.ndarray, "3"]:
        """Return where the arm is (m), from a message that arrives now; sends nothing.

        Raises:
            NoFeedback: no valid message arrives.
        """
        self._transport.discard()
        end = self._clock.now() + PATIENCE
        reason = "nothing arrived"
        while (left := end - self._clock.now()) > 0:
            try:
                data = self._transport.receive(left)
                if data is not None:
                    return decode_feedback(data).position
            except Stopped as stopped:
                reason = str(stopped)
        raise NoFeedback(
            f"no feedback from the controller for {PATIENCE:g} s ({reason}); check "
            "that the RAPID program runs and sends to this machine and port."
        )

    def follow(
        self, path: Float[np.ndarray, "time 3"], watch: Callable[[], str] = unwatched
    ) -> Stroke:
        """Follow positions (m), one for each cycle, and hold the last until it rests.

        Args:
            path: positions.
            watch: called in every cycle; a reason that it returns stops the motion.

        Returns:
            The samples, with the reason if the motion was refused or stopped.
        """
        samples: list[Sample] = []
        try:
            watchdog, rest = self._ready()
            rows = self._limits.rows(rest.position, path)
            with self._clock.undisturbed():
                for _ in self._stream(rows, rest.orientation, watchdog, samples):
                    if reason := watch():
                        raise Stopped(reason)
        except Stopped as stopped:
            return Stroke.of(samples, str(stopped))
        return Stroke.of(samples)

    def _ready(self) -> tuple[Watchdog, Feedback]:
        """Return the feedback of an arm that rests and executes motion.

        A controller that does not execute motion yet is answered with the position that
        it reports, which keeps its session open and moves nothing.
        """
        self._transport.discard()
        end = self._clock.now() + PATIENCE
        watchdog, first, good = Watchdog(self._limits, end - PATIENCE), None, 0
        while True:
            try:
                feedback, now = self._next(watchdog)
                first = first or feedback
                if np.linalg.norm(feedback.position - first.position) > _REST:
                    raise Stopped("the arm moves")
                good += 1
                if good == _READY:
                    return watchdog, feedback
            except Stopped as stopped:
                now = self._clock.now()
                if now > end:
                    raise Stopped(
                        f"the controller was not ready within {PATIENCE:g} s: {stopped}"
                    ) from stopped
                if isinstance(stopped, Idle):
                    self._answer_idle(now, stopped.feedback)
                watchdog, first, good = Watchdog(self._limits, now), None, 0

    def _answer_idle(self, now: float, feedback: Feedback) -> None:
        if self._limits.contain(feedback.position):
            self._answer(now, feedback.position, feedback.orientation)

    def _stream(
        self,
        rows: Float[np.ndarray, "row 3"],
        orientation: Quaternion,
        watchdog: Watchdog,
        samples: list[Sample],
    ) -> Iterator[None]:
        """Answer each message with the next row; yield after each answer."""
        row, moved = -1, -np.inf
        while row + 1 < len(rows):
            feedback, now = self._next(watchdog)
            # Messages that were held up arrive close together; a row for each of them
            # would be too fast.
            if now - moved >= CYCLE / 2:
                row, moved = row + 1, now
            self._answer(now, rows[row], orientation)
            watchdog.commanded(rows[row])
            samples.append((now, rows[row], feedback.position))
            yield

    def _next(self, watchdog: Watchdog) -> tuple[Feedback, float]:
        """Return the newest feedback and its arrival; older ones are checked too."""
        data = self._transport.receive(watchdog.deadline - self._clock.now())
        if data is None:
            raise watchdog.late(self._clock.now())
        for _ in range(_MOST_AT_ONCE):
            now = self._clock.now()
            feedback = decode_feedback(data)
            watchdog.check(feedback, now)
            data = self._transport.receive(0.0)
            if data is None:
                return feedback, now
        raise Stopped(f"{_MOST_AT_ONCE} messages arrived at once")

    def _answer(
        self, now: float, position: Float[np.ndarray, "3"], orientation: Quaternion
    ) -> None:
        self._sent += 1
        stamp = int(1000 * now)
        self._transport.send(encode_command(self._sent, stamp, position, orientation))
