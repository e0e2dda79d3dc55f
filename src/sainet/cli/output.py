"""Output of commands: text for people, or one JSON object at the end."""

import json
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.console import Console


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

    def say(self, text: str, *, markup: bool = False) -> None:
        """Print a line about the progress, unless quiet.

        Args:
            text: a line; it is not wrapped, because it may contain a command to copy.
            markup: whether brackets are Rich's markup; in a path they are text.
        """
        if not self.quiet:
            self.console.print(text, markup=markup, soft_wrap=True)

    def warn(self, text: str) -> None:
        """Print a warning, even when quiet."""
        print(text, file=sys.stderr)


def finish(result: Json, output: Output) -> None:
    """Print the result of a command as JSON if that was asked for."""
    if output.json:
        print(json.dumps(result, allow_nan=False))
        sys.stdout.flush()
