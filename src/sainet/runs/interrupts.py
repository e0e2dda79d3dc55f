"""Ctrl-C that is not lost: remembered where the exception it raised was swallowed.

Python prints and forgets an exception in a finaliser or in a callback of the garbage
collector, and JAX registers such callbacks. Work that takes long calls
`raise_if_interrupted` at every step, so that it ends all the same.
"""

import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from typing import Any

INTERRUPTED = 130  # exit status


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
    printed = sys.unraisablehook
    sys.unraisablehook = partial(_unless_interrupted, printed)
    try:
        yield
        raise_if_interrupted()
    finally:
        sys.unraisablehook = printed
        signal.signal(signal.SIGINT, before)
        _interrupts.have_come = False


def _unless_interrupted(printed: Callable[[Any], None], found: Any) -> None:  # noqa: ANN401
    """Print an exception of a finaliser, but none of Ctrl-C: that is remembered."""
    if found.exc_type is not KeyboardInterrupt:
        printed(found)


@contextmanager
def interrupts_wait() -> Iterator[None]:
    """Only remember Ctrl-C in this context: imports of native code cannot end early.

    Raises:
        KeyboardInterrupt: Ctrl-C was pressed in `remembered_interrupts`.
    """
    before = signal.getsignal(signal.SIGINT)
    if before is not _interrupt:
        yield
        return
    signal.signal(signal.SIGINT, lambda number, frame: remember_interrupt())
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
    raise_if_interrupted()


def end_at_interrupts() -> None:
    """End this process at Ctrl-C, in one line, while nothing can be lost yet."""
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, _end)


def raise_interrupts() -> None:
    """Raise Ctrl-C as an exception again, after `end_at_interrupts`."""
    if signal.getsignal(signal.SIGINT) is _end:
        signal.signal(signal.SIGINT, signal.default_int_handler)


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


def _end(number: int, frame: object) -> None:
    os.write(2, b"sainet: interrupted before it began.\n")
    os._exit(INTERRUPTED)


def _interrupt(number: int, frame: object) -> None:
    remember_interrupt()
    raise KeyboardInterrupt
