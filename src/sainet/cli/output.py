"""Output of commands: text, progress bars, or one JSON object at the end."""

import json
import os
import shlex
import sys
from collections.abc import Mapping
from contextlib import AbstractContextManager, ExitStack, suppress
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING

from sainet.runs import progress
from sainet.runs.progress import COMPILING, Advance

if TYPE_CHECKING:
    from _typeshed import DataclassInstance
    from rich.console import Console

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
    if sys.stdout is not None:  # pyright: ignore[reportUnnecessaryComparison]
        sys.stdout.flush()  # here, where an error is reported


def drop_output() -> None:
    """Drop what standard output did not take; Python would try again at its end."""
    with suppress(OSError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def command_of(name: str, settings: "DataclassInstance", **others: object) -> str:
    """Return a command line with the settings that differ from their defaults.

    Args:
        name: of the command.
        settings: options of the command.
        others: further options.
    """
    usual, words = type(settings)(), ["sainet", name]
    given = {k: v for k, v in asdict(settings).items() if v != getattr(usual, k)}
    for option, value in (given | others).items():
        words += [f"--{option.replace('_', '-')}", *[str(value)] * (value is not True)]
    return shlex.join(words)


def progress_bar(
    title: str, total: int | None, output: Output, *, waiting: str = COMPILING
) -> AbstractContextManager[Advance]:
    """Return a progress bar that `quiet` hides; see `runs.progress`."""
    return progress.progress_bar(title, total, quiet=output.quiet, waiting=waiting)


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
        self._advance(event.done - self._done, _note(event))
        self._done = event.done
        if event.has_ended:
            self._bar.close()
            self._advance = None

    def __enter__(self) -> "Bars":
        """Return these bars."""
        return self

    def __exit__(self, *error: object) -> None:
        """Stop the bar that an error interrupted."""
        self._bar.close()


def _note(event: "Progress") -> str:
    """Return the note of an event, with the remaining time of all steps."""
    from sainet.studies.durations import in_words

    left = f"{in_words(event.left)} left in all" if event.left else ""
    return " · ".join(filter(None, (event.note, left)))
