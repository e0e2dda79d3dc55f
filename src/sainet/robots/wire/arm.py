"""Arms that follow paths, and the rehearsal that sends nothing."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from types import TracebackType
from typing import ClassVar, final

import numpy as np
from jaxtyping import Float

from sainet.robots.wire.limits import CYCLE, Limits, Stopped
from sainet.runs.documents import checked
from sainet.runs.errors import SainetError


class NoFeedback(SainetError):
    """A controller that sends no usable feedback."""


@dataclass(frozen=True, kw_only=True)
class Stroke:
    """Samples of one motion: one for each message that was answered."""

    time: Float[np.ndarray, " sample"]  # s, of the arm's clock, at arrival
    commanded: Float[np.ndarray, "sample 3"]  # m, answer to the message
    measured: Float[np.ndarray, "sample 3"]  # m, in the message
    trouble: str = ""  # why the motion was stopped or refused; empty: it was not


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

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Let go of the arm."""
        self.close()

    def close(self) -> None:  # noqa: B027
        """Let go of the arm."""


class Samples:
    """Samples of a stroke while it is made."""

    def __init__(self) -> None:
        """Start without samples."""
        self._rows: list[tuple[float, np.ndarray, np.ndarray]] = []

    def add(
        self,
        time: float,
        commanded: Float[np.ndarray, "3"],
        measured: Float[np.ndarray, "3"],
    ) -> None:
        """Add a time (s), the answer (m) and the measured position (m)."""
        self._rows.append((time, commanded, measured))

    def stroke(self, trouble: str = "") -> Stroke:
        """Return the stroke so far, with the reason why it was stopped."""
        return Stroke(
            time=np.array([row[0] for row in self._rows]),
            commanded=np.array([row[1] for row in self._rows]).reshape(-1, 3),
            measured=np.array([row[2] for row in self._rows]).reshape(-1, 3),
            trouble=trouble,
        )


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
        samples = Samples()
        try:
            for row in self._limits.rows(self._position, path):
                self._show(self._time, row)
                samples.add(self._time, row, row)
                self._time += CYCLE
                self._position = row
        except Stopped as stopped:
            return samples.stroke(str(stopped))
        return samples.stroke()
