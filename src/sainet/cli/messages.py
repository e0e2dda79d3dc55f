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
    options = set(_options(command)) if command else set()

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


def _options(settings: Any) -> Iterator[str]:  # noqa: ANN401
    """Yield the names of all options of a dataclass of settings, nested ones too."""
    hints = get_type_hints(settings, include_extras=True)
    for field in fields(settings):
        hint = hints[field.name]
        extras = getattr(hint, "__metadata__", ())
        kind = get_args(hint)[0] if extras else hint
        parts = [part for part in (kind, *get_args(kind)) if is_dataclass(part)]
        for part in parts:
            yield from _options(part)
        if not parts and _POSITIONAL not in extras:
            yield field.name
