"""Output of commands: text, progress bars, or one JSON object at the end."""

import json
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from types import TracebackType
from typing import TYPE_CHECKING

from sainet.runs.interrupts import raise_if_interrupted

if TYPE_CHECKING:
    from rich.console import Console

if TYPE_CHECKING:
    from sainet.studies.runner import Progress


Json = Mapping[str, object]  # the object that a command prints with `json`


@dataclass(frozen=True, kw_only=True)
class Output:
    """Options of every command."""

    json: bool = False
    """Print the result as one JSON object on standard output, all other text on
    standard error."""
    quiet: bool = False
    """Hide progress."""

    @property
    def console(self) -> "Console":
        """The console for text that people read."""
        from rich.console import Console

        return Console(stderr=self.json, highlight=False)

    def say(self, text: str) -> None:
        """Print a line about the progress, unless quiet.

        Args:
            text: a line; it is not wrapped, because it may contain a command to copy.
        """
        if not self.quiet:
            self.console.print(text, markup=False, soft_wrap=True)

    def warn(self, text: str) -> None:
        """Print a warning, even when quiet."""
        print(text, file=sys.stderr)


def finish(result: Json, output: Output) -> None:
    """Print the result of a command as JSON if that was asked for."""
    if output.json:
        print(json.dumps(result, allow_nan=False))
        sys.stdout.flush()


Advance = Callable[[int, str], None]  # number of finished units, and a note
COMPILING = "compiling"


@dataclass
class Pace:
    """Rate of the units after the first report, whose time includes compilation."""

    begun: float | None = None  # s, time of the first report
    counted: int = 0  # units since then

    def add(self, units: int) -> float | None:
        """Count units; returns units per second, None until two reports."""
        now = time.perf_counter()
        if self.begun is None:
            self.begun = now if units else None
            return None
        self.counted += units
        return self.counted / (now - self.begun) if self.counted else None


@contextmanager
def progress_bar(
    title: str, total: int | None, output: Output, *, waiting: str = COMPILING
) -> Iterator[Advance]:
    """Show a progress bar and yield the function that advances it.

    Args:
        title: text before the bar.
        total: number of units; None where it is unknown.
        output: `quiet` shows nothing.
        waiting: note until the first units are finished; the bar pulses meanwhile.
    """
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeRemainingColumn,
    )

    columns = (
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.fields[rate]}", style="cyan"),
        TimeRemainingColumn(elapsed_when_finished=True),
        TextColumn("{task.fields[note]}", markup=False),
    )
    bar = Progress(*columns, console=Console(stderr=True), disable=output.quiet)
    pace = Pace()
    with bar:
        task = bar.add_task(title, total=None, note=waiting, rate="")

        def advance(amount: int, note: str = "") -> None:
            raise_if_interrupted()
            rate = pace.add(amount)
            begun = pace.begun is not None
            bar.update(
                task,
                advance=amount,
                total=total if begun else None,
                note=note if begun else note or waiting,
                rate="" if rate is None else f"{rate:.1f}/s",
            )

        yield advance
        if pace.begun is None:  # everything was finished before
            bar.update(task, total=total, completed=total or 0, note="")


class Bars:
    """Shows the progress of a runner's steps, one bar at a time."""

    def __init__(self, output: Output) -> None:
        """Show no bar yet."""
        self._output, self._bar, self._done = output, ExitStack(), 0
        self._advance: Advance | None = None

    def __call__(self, event: "Progress") -> None:
        """Show an event on the bar of its step."""
        if self._advance is None:
            bar = progress_bar(event.title, event.total, self._output)
            self._advance, self._done = self._bar.enter_context(bar), 0
        self._advance(event.done - self._done, event.note)
        self._done = event.done
        if event.has_ended:
            self._bar.close()
            self._advance = None

    def __enter__(self) -> "Bars":
        """Return these bars."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Stop the bar that an error interrupted."""
        self._bar.close()
