"""Arms that follow paths, and the rehearsal that sends nothing."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import ClassVar, final

import numpy as np
from jaxtyping import Float

from sainet.robots.wire.limits import CYCLE, Limits, Stopped
from sainet.runs.documents import checked
from sainet.runs.errors import SainetError


class NoFeedback(SainetError):
    """A controller that sends no usable feedback."""


Point = Float[np.ndarray, "3"]  # m, in the base frame
Sample = tuple[float, Point, Point]  # s; m, answer to a message; m, in the message


@dataclass(frozen=True, kw_only=True)
class Stroke:
    """Samples of one motion: one for each message that was answered."""

    time: Float[np.ndarray, " sample"]  # s, of the arm's clock, at arrival
    commanded: Float[np.ndarray, "sample 3"]  # m, answer to the message
    measured: Float[np.ndarray, "sample 3"]  # m, in the message
    trouble: str = ""  # why the motion was stopped or refused; empty: it was not

    @classmethod
    def of(cls, samples: Sequence[Sample], trouble: str = "") -> "Stroke":
        """Return the stroke with these samples."""
        time, commanded, measured = zip(*samples, strict=True) if samples else ((),) * 3
        return cls(
            time=np.array(time),
            commanded=np.reshape(commanded, (-1, 3)),
            measured=np.reshape(measured, (-1, 3)),
            trouble=trouble,
        )


def unwatched() -> str:
    """Return no reason to stop a motion."""
    return ""


class AbstractArm(ABC):
    """An arm, which carries the pusher; positions are in its base frame."""

    rehearsal: ClassVar[str] = ""  # why nothing moves; empty: the arm moves

    @abstractmethod
    def position(self) -> Float[np.ndarray, "3"]:
        """Return where the arm is (m).

        Raises:
            NoFeedback: it cannot be measured.
        """

    @abstractmethod
    def follow(
        self, path: Float[np.ndarray, "time 3"], watch: Callable[[], str] = unwatched
    ) -> Stroke:
        """Follow positions (m), one for each cycle, and hold the last until it rests.

        A motion that is refused or stopped is a stroke with its reason; the arm then
        rests at the last commanded position.

        Args:
            path: positions.
            watch: called in every cycle; a reason that it returns stops the motion.
        """

    def __enter__(self) -> "AbstractArm":
        """Return the arm."""
        return self

    def __exit__(self, *error: object) -> None:
        """Let go of the arm."""
        self.close()

    def close(self) -> None:  # noqa: B027
        """Let go of the arm."""


@final
class DryArm(AbstractArm):
    """Shows every command instead of sending one, and moves perfectly."""

    rehearsal = "dry run: nothing was sent"

    def __init__(
        self,
        start: Float[np.ndarray, "3"],
        limits: Limits,
        show: Callable[[float, Float[np.ndarray, "3"]], None],
    ) -> None:
        """Prepare the rehearsal.

        Args:
            start: where the arm is (m).
            limits: of the robot.
            show: called with the time (s) and the position (m) of each command.
        """
        self._position = start
        self._limits = checked(limits, "limits")
        self._show = show
        self._time = 0.0

    def position(self) -> Float[np.ndarray, "3"]:
        """Return where the arm would be (m)."""
        return self._position

    def follow(
        self, path: Float[np.ndarray, "time 3"], watch: Callable[[], str] = unwatched
    ) -> Stroke:
        """Show the positions of a path (m), if the limits allow it."""
        samples: list[Sample] = []
        try:
            for row in self._limits.rows(self._position, path):
                self._show(self._time, row)
                samples.append((self._time, row, row))
                self._time += CYCLE
                self._position = row
        except Stopped as stopped:
            return Stroke.of(samples, str(stopped))
        return Stroke.of(samples)
