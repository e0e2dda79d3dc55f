"""What every command prints: text for people, or one JSON object at the end."""

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
        """Where text for people goes."""
        from rich.console import Console

        return Console(stderr=self.json, highlight=False)

    def say(self, text: str, *, markup: bool = False) -> None:
        """Say what is being done, unless quiet.

        Args:
            text: a line; it is not broken, for it may hold a command to copy.
            markup: whether brackets are Rich's markup; in a path they are its own.
        """
        if not self.quiet:
            self.console.print(text, markup=markup, soft_wrap=True)

    def warn(self, text: str) -> None:
        """Say what the result lacks, quiet or not: it is no progress."""
        print(text, file=sys.stderr)


def finish(result: Json, output: Output) -> None:
    """Print the result of a command as JSON if that was asked for."""
    if output.json:
        print(json.dumps(result, allow_nan=False))
        sys.stdout.flush()
