"""Ctrl-C that is not lost: remembered where the exception it raised was swallowed.

Python prints and forgets an exception in a finaliser or in a callback of the garbage
collector, and JAX registers such callbacks. Work that takes long calls
`raise_if_interrupted` at every step, so that it ends all the same.
"""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass


@dataclass
class _Interrupts:
    """Whether a signal to interrupt has come."""

    have_come: bool = False


_interrupts = _Interrupts()  # one per process, as signal handlers are


@contextmanager
def remembered_interrupts() -> Iterator[None]:
    """Remember Ctrl-C in this context, and raise it at the end if it was swallowed.

    Does nothing outside the main thread, or where the signal is ignored or handled
    otherwise: background jobs of a shell ignore it.

    Raises:
        KeyboardInterrupt: Ctrl-C was pressed.
    """
    is_main = threading.current_thread() is threading.main_thread()
    before = signal.getsignal(signal.SIGINT)
    if not is_main or before is not signal.default_int_handler:
        yield
        return
    signal.signal(signal.SIGINT, _interrupt)
    try:
        yield
        raise_if_interrupted()
    finally:
        signal.signal(signal.SIGINT, before)
        _interrupts.have_come = False


def raise_if_interrupted() -> None:
    """Raise the interrupt that has come, if one has.

    Raises:
        KeyboardInterrupt: it has.
    """
    if _interrupts.have_come:
        raise KeyboardInterrupt


def remember_interrupt() -> None:
    """Remember that an interrupt has come; for signal handlers."""
    _interrupts.have_come = True


def forget_interrupts() -> None:
    """Forget what has come; for a job that begins after another one was ended."""
    _interrupts.have_come = False


def _interrupt(number: int, frame: object) -> None:
    remember_interrupt()
    raise KeyboardInterrupt
