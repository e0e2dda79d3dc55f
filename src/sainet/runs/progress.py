"""Progress bars on standard error."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from sainet.runs.interrupts import raise_if_interrupted

Advance = Callable[[int, str], None]  # number of finished units, and a note
COMPILING = "compiling"
_SLOW = 0.1  # units per second: no rate is shown of fewer


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
    title: str, total: int | None, *, quiet: bool = False, waiting: str = COMPILING
) -> Iterator[Advance]:
    """Show a progress bar and yield the function that advances it.

    Args:
        title: text before the bar.
        total: number of units; None where it is unknown.
        quiet: show nothing.
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
    pace, bar = Pace(), Progress(*columns, console=Console(stderr=True), disable=quiet)
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
                rate=f"{rate:.1f}/s" if rate and rate >= _SLOW else "",
            )

        try:
            yield advance
        except Exception:
            bar.live.transient = pace.begun is None  # refused before anything was done
            raise
        if pace.begun is None:  # everything was finished before
            bar.update(task, total=total, completed=total or 0, note="")
