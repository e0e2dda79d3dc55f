"""The watchdog, which stops a motion when the feedback is not as it must be."""

from collections import deque

import numpy as np
from jaxtyping import Float

from sainet.robots.wire.egm import Feedback
from sainet.robots.wire.limits import CYCLE, Limits, Stopped, in_mm

_WRAP = 1 << 32  # sequence numbers and time stamps begin again at 0
_FROZEN_STEP = 2e-5  # m a cycle; a slower arm may report one position twice


class Idle(Stopped):
    """The controller executes no motion."""

    def __init__(self, feedback: Feedback) -> None:
        """Keep the feedback."""
        super().__init__(f"the controller stopped: {feedback.idle}")
        self.feedback = feedback


class Watchdog:
    """Checks each message of one motion against the messages and answers before it.

    A controller follows its commands with a lag, so the arm is compared with the
    stretch of the path that was commanded during the longest lag.
    """

    def __init__(self, limits: Limits, now: float) -> None:
        """Start watching.

        Args:
            limits: of the robot.
            now: time (s) from which the first message is waited for.
        """
        self._limits = limits
        self._arrival = now
        self._last: Feedback | None = None
        self._trail: deque[Float[np.ndarray, "3"]] = deque(maxlen=limits.lag_cycles + 1)
        self._moving = 0  # answers in a row that moved
        self._same = 0  # messages in a row with one position

    @property
    def deadline(self) -> float:
        """The time (s) until which the next message must arrive."""
        return self._arrival + self._limits.age * CYCLE

    def commanded(self, position: Float[np.ndarray, "3"]) -> None:
        """Note a position (m) that is sent."""
        far = self._trail and np.linalg.norm(position - self._trail[-1]) > _FROZEN_STEP
        self._moving = self._moving + 1 if far else 0
        self._trail.append(position)

    def check(self, feedback: Feedback, now: float) -> None:
        """Check a message that arrived at a time (s).

        Raises:
            Stopped: with the reason for which the motion must stop.
        """
        if now > self.deadline:
            raise self.late(now)
        if self._last is not None:
            self._check_order(feedback, self._last)
        if feedback.idle:
            raise Idle(feedback)
        if self._trail:
            self._check_line(feedback.position)
        self._last, self._arrival = feedback, now

    def late(self, now: float) -> Stopped:
        """Return the reason for a motion that stops at a time (s) without feedback."""
        return Stopped(
            f"no feedback for {1000 * (now - self._arrival):.1f} ms; the limit is "
            f"{1000 * self._limits.age * CYCLE:.1f} ms ({self._limits.age:g} cycles)"
        )

    def _check_order(self, feedback: Feedback, last: Feedback) -> None:
        ahead = (feedback.sequence - last.sequence) % _WRAP
        if ahead == 0:
            raise Stopped(f"repeated feedback: message {feedback.sequence} came twice")
        if ahead >= _WRAP // 2:
            raise Stopped(
                f"feedback out of order: message {feedback.sequence} after "
                f"{last.sequence}"
            )
        if ahead > 1:
            raise Stopped(
                f"missing feedback: {ahead - 1} lost before message {feedback.sequence}"
            )
        if (feedback.stamp - last.stamp) % _WRAP >= _WRAP // 2:
            raise Stopped(
                f"feedback out of order: the controller's clock went from {last.stamp} "
                f"to {feedback.stamp} ms"
            )

    def _check_line(self, position: Float[np.ndarray, "3"]) -> None:
        distance = _distance(np.array(self._trail), position)
        if distance > self._limits.line:
            raise Stopped(
                f"the arm is {1000 * distance:.1f} mm off the commanded path, at "
                f"{in_mm(position)}; the limit is {1000 * self._limits.line:.1f} mm"
            )
        same = self._last is not None and bool((position == self._last.position).all())
        self._same = self._same + 1 if same else 0
        if self._same >= self._limits.age and self._moving >= self._limits.lag_cycles:
            raise Stopped(
                f"frozen feedback: {self._same + 1} messages in a row report "
                f"{in_mm(position)}"
            )


def _distance(
    corners: Float[np.ndarray, "corner 3"], point: Float[np.ndarray, "3"]
) -> float:
    """Return the distance (m) from a point to the line through corners."""
    start, along = corners[:-1], np.diff(corners, axis=0)
    length2 = np.maximum((along**2).sum(axis=1), 1e-18)
    share = np.clip(((point - start) * along).sum(axis=1) / length2, 0.0, 1.0)
    nearest = np.concatenate([start + share[:, None] * along, corners[-1:]])
    return float(np.sqrt(((nearest - point) ** 2).sum(axis=1).min()))
