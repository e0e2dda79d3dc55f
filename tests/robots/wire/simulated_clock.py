"""A clock for tests: a simulation advances it."""

from sainet.robots.wire.clock import AbstractClock


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
