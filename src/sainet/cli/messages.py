"""Errors of the library as lines of the command line."""

import re
from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from typing import Any, get_args, get_type_hints

from tyro.conf import Positional

from sainet.runs.errors import SainetError, shown

_POSITIONAL = get_args(Positional[int])[1]
_LONGEST = 300  # characters of a line
_MOST_LINES = 50
_QUOTED = re.compile(r"`([a-z][a-z0-9_]*)`")


def message(error: SainetError, command: type | None = None) -> str:
    """Return the message of an error, with options for settings.

    Most messages are one line; a few list several problems, one a line. The library
    quotes settings in backquotes; those that the command has as options
    become `--name`.

    Args:
        error: of the library.
        command: the dataclass of the command that was called, if it is known.
    """
    options = _options(command) if command else set()

    def option(found: re.Match[str]) -> str:
        name = found[1]
        return "--" + name.replace("_", "-") if name in options else found[0]

    lines = str(error).splitlines()[:_MOST_LINES]
    return "\n".join(_short(_QUOTED.sub(option, shown(line, None))) for line in lines)


def _short(line: str) -> str:
    if len(line) <= _LONGEST:
        return line
    # The end holds the remedy.
    half = (_LONGEST - len(" ... ")) // 2
    return f"{line[:half]} ... {line[-half:]}"


def _options(command: type) -> set[str]:
    """Return the names of all options of a command, without its positional ones."""
    names = dict(_fields(command))
    return {name for name, is_option in names.items() if is_option}


def _fields(settings: Any) -> Iterator[tuple[str, bool]]:  # noqa: ANN401
    """Yield each name and whether it is an option; outer fields come last and win."""
    hints = get_type_hints(settings, include_extras=True)
    own = []
    for field in fields(settings):
        hint = hints[field.name]
        if is_dataclass(hint):
            yield from _fields(hint)
        else:
            own.append(
                (field.name, _POSITIONAL not in getattr(hint, "__metadata__", ()))
            )
    yield from own
