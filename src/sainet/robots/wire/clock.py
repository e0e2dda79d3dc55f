"""Clocks, so that the same code runs in real time and in simulated time."""

import gc
import os
import time
from abc import ABC, abstractmethod
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress
from typing import final


class AbstractClock(ABC):
    """A clock that never goes backwards."""

    @abstractmethod
    def now(self) -> float:
        """Return the time (s) since an arbitrary start."""

    @abstractmethod
    def wait(self, seconds: float) -> None:
        """Let time pass."""

    def undisturbed(self) -> AbstractContextManager[None]:
        """Return a context that is interrupted as little as possible."""
        return nullcontext()


@final
class RealClock(AbstractClock):
    """The monotonic clock of the machine."""

    def now(self) -> float:
        """Return the time (s) since an arbitrary start."""
        return time.monotonic()

    def wait(self, seconds: float) -> None:
        """Let time pass."""
        time.sleep(seconds)

    @contextmanager
    def undisturbed(self) -> Iterator[None]:
        """Keep out garbage collection and, where permitted, other processes.

        A thread of real-time priority that waits for messages needs little of a
        processor.
        """
        collected = gc.isenabled()
        gc.disable()
        policy, priority = os.sched_getscheduler(0), os.sched_getparam(0)
        with suppress(OSError):
            os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))
        try:
            yield
        finally:
            os.sched_setscheduler(0, policy, priority)
            if collected:
                gc.enable()
