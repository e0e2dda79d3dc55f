"""Clocks, so that the same code runs in real time and in simulated time."""

import time
from abc import ABC, abstractmethod
from typing import final


class AbstractClock(ABC):
    """A clock that never goes backwards."""

    @abstractmethod
    def now(self) -> float:
        """Return the time (s) since an arbitrary start."""

    @abstractmethod
    def wait(self, seconds: float) -> None:
        """Let time pass."""


@final
class RealClock(AbstractClock):
    """The monotonic clock of the machine."""

    def now(self) -> float:
        """Return the time (s) since an arbitrary start."""
        return time.monotonic()

    def wait(self, seconds: float) -> None:
        """Let time pass."""
        time.sleep(seconds)


@final
class SimulatedClock(AbstractClock):
    """A clock that a simulation advances."""

    def __init__(self) -> None:
        """Start at zero."""
        self._now = 0.0

    def now(self) -> float:
        """Return the simulated time (s)."""
        return self._now

    def wait(self, seconds: float) -> None:
        """Let time pass."""
        self.advance_to(self._now + seconds)

    def advance_to(self, moment: float) -> None:
        """Move the clock to a moment (s); an earlier moment changes nothing."""
        self._now = max(self._now, moment)
