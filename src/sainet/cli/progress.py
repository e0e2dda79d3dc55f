"""A progress bar with rate and time left, on standard error."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from sainet.cli.output import Output
from sainet.runs.interrupts import raise_if_interrupted

Advance = Callable[[int, str], None]  # by how much, and a note


@contextmanager
def progress_bar(title: str, total: int | None, output: Output) -> Iterator[Advance]:
    """Show a bar while something goes on; what is given advances it.

    Args:
        title: what is going on.
        total: how much there is to do; None where nobody knows.
        output: `quiet` shows nothing.
    """
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        ProgressColumn,
        Task,
        TextColumn,
        TimeRemainingColumn,
    )
    from rich.text import Text

    class Rate(ProgressColumn):
        """How much is done in a second."""

        def render(self, task: Task) -> Text:
            speed = task.finished_speed or task.speed
            return Text(f"{speed:.1f}/s" if speed else "", style="cyan")

    columns = (
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        MofNCompleteColumn(),
        Rate(),
        TimeRemainingColumn(),
        TextColumn("{task.fields[note]}", markup=False),
    )
    bar = Progress(*columns, console=Console(stderr=True), disable=output.quiet)
    with bar:
        task = bar.add_task(title, total=total, note="")

        def advance(amount: int, note: str = "") -> None:
            raise_if_interrupted()
            bar.update(task, advance=amount, note=note)

        yield advance
