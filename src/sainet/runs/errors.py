"""The few errors of the package: each message is one line that names the way out."""

from collections.abc import Iterable
from difflib import get_close_matches

_LONGEST_SHOWN = 60  # characters of a quoted value


class SainetError(Exception):
    """Something that the user can act upon; the command line exits with 1."""

    exit_status = 1


class BadInput(SainetError):
    """What was given cannot be used; the command line exits with 2."""

    exit_status = 2


class BadScene(BadInput):
    """A scene that cannot exist: a mass or radius that is not positive, say."""


class BadStore(BadInput):
    """A stored dataset that is missing, damaged, unfinished or of another kind."""


class BadTable(BadInput):
    """Files of recorded pushes that cannot be used; each problem is one line."""

    def __init__(self, *problems: str) -> None:
        """Keep the problems, the first of each kind; each line names its file."""
        super().__init__("\n".join(problems))
        self.problems = problems


class BadCheckpoint(BadInput):
    """A trained network that is missing or damaged, or does not fit its use."""


class RunConflict(BadInput):
    """A folder already holds something other than what was asked for."""


class UnknownName(BadInput):
    """A name that no registry holds."""


class MissingExtra(BadInput):
    """What was asked for needs a package that is not installed."""


class Diverged(SainetError):
    """A rollout or a training run left the finite numbers."""


class BadSetting(BadInput):
    """A setting whose value cannot be used.

    The message quotes the setting in backquotes, spelled as the argument or field of
    the library; the command line replaces the quoted name by its option.
    """

    def __init__(self, name: str, value: object, wanted: str) -> None:
        """Keep the parts of the message.

        Args:
            name: of the argument or field.
            value: that was given.
            wanted: the values that can be used: "at least 1".
        """
        super().__init__(name, value, wanted)
        self.name = name
        self.value = value
        self.wanted = wanted

    def __str__(self) -> str:
        """Return the message."""
        return f"`{self.name}` is {shown(self.value)}; it must be {self.wanted}."


def require(condition: bool, name: str, wanted: str, value: object) -> None:
    """Raise `BadSetting` unless a condition on a setting's value holds."""
    if not condition:
        raise BadSetting(name, value, wanted)


def require_one_of(name: str, value: str, known: Iterable[str]) -> None:
    """Raise `BadSetting`, with the nearest name, for a name that is not known."""
    known = tuple(known)
    if value not in known:
        raise BadSetting(name, value, f"one of {', '.join(known)}{hint(value, known)}")


def unknown_name(kind: str, name: str, known: Iterable[str]) -> UnknownName:
    """Return the error for a name that is not among the known ones.

    Args:
        kind: of the thing that has the name: "engine".
        name: that was given.
        known: every name of that kind.
    """
    known = sorted(known)
    return UnknownName(
        f"No {kind} named '{shown(name)}'{hint(name, known)}. "
        f"Available: {', '.join(known) or 'none'}."
    )


def hint(name: str, known: Iterable[str]) -> str:
    """Return " (did you mean ...?)" for the known name that resembles a name most."""
    nearest = get_close_matches(name[:_LONGEST_SHOWN], tuple(known), n=1)
    return f" (did you mean {nearest[0]}?)" if nearest else ""


def shown(value: object, most: int | None = _LONGEST_SHOWN) -> str:
    """Return a value as part of a line: printable, at most so many characters."""
    try:
        text = str(value)
    except (ValueError, RecursionError):  # an integer of thousands of digits
        return f"a {type(value).__name__} too large to print"
    short = text if most is None or len(text) <= most else text[:most] + "..."
    # An unpaired surrogate could not be printed.
    return "".join(
        c if c.isprintable() else c.encode("unicode_escape").decode() for c in short
    )
