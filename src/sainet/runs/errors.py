"""Errors of the package: each message is one line that names a remedy."""

from collections.abc import Iterable
from difflib import get_close_matches

_LONGEST_SHOWN = 60  # characters of a quoted value


class SainetError(Exception):
    """Error that the user can act on; the command line exits with status 1."""

    exit_status = 1


class BadInput(SainetError):
    """Input that cannot be used; the command line exits with status 2."""

    exit_status = 2


class BadScene(BadInput):
    """An impossible scene, for example with a negative mass."""


class BadStore(BadInput):
    """A stored dataset that is missing, damaged, unfinished or of another kind."""


class BadTable(BadInput):
    """Files of recorded pushes that cannot be used; each problem is one line."""

    def __init__(self, *problems: str) -> None:
        """Keep the problems; each line names its file."""
        super().__init__("\n".join(problems))
        self.problems = problems


class BadCheckpoint(BadInput):
    """A trained network that is missing or damaged, or does not fit its use."""


class RunConflict(BadInput):
    """A folder that belongs to another run or process."""


class UnknownName(BadInput):
    """A name that is not registered."""


class MissingExtra(BadInput):
    """A request that needs a package that is not installed."""


class Diverged(SainetError):
    """A rollout or training run that produced NaN or infinity."""


class BadSetting(BadInput):
    """A setting whose value cannot be used.

    The message quotes the setting in backquotes, spelled as the argument or field of
    the library; the command line replaces the quoted name by its option.
    """

    def __init__(self, name: str, value: object, wanted: str) -> None:
        """Store the parts of the message.

        Args:
            name: name of the argument or field.
            value: given value.
            wanted: accepted values, for example "at least 1".
        """
        super().__init__(name, value, wanted)
        self.name = name
        self.value = value
        self.wanted = wanted

    def __str__(self) -> str:
        """Return the message."""
        return f"`{self.name}` is {shown(self.value)}; it must be {self.wanted}."


def require(condition: bool, name: str, wanted: str, value: object) -> None:
    """Raise `BadSetting` unless a condition on the value of a setting holds."""
    if not condition:
        raise BadSetting(name, value, wanted)


def require_one_of(name: str, value: str, known: Iterable[str]) -> None:
    """Raise `BadSetting`, with the nearest name, for an unknown name."""
    known = tuple(known)
    if value not in known:
        raise BadSetting(name, value, f"one of {', '.join(known)}{hint(value, known)}")


def unknown_name(kind: str, name: str, known: Iterable[str]) -> UnknownName:
    """Return the error for an unknown name.

    Args:
        kind: kind of the named object, for example "engine".
        name: given name.
        known: all names of this kind.
    """
    known = sorted(known)
    return UnknownName(
        f"No {kind} named '{shown(name)}'{hint(name, known)}. "
        f"Available: {', '.join(known) or 'none'}."
    )


def missing_extra(needs: str, extra: str, instead: str = "") -> MissingExtra:
    """Return the error for a package that an extra adds.

    The advice works from any folder: pip takes the sainet that is installed, also one
    from a clone, and adds the packages of the extra.

    Args:
        needs: what needs which package, for example "Parquet needs pyarrow".
        extra: name of the extra.
        instead: what works without it.
    """
    otherwise = f"; without it {instead}" if instead else ""
    return MissingExtra(f"{needs}: pip install 'sainet[{extra}]'{otherwise}.")


def hint(name: object, known: Iterable[str]) -> str:
    """Return " (did you mean ...?)" with the most similar known name, or nothing."""
    in_lower_case = {each.lower(): each for each in known}
    nearest = get_close_matches(shown(name).lower(), in_lower_case, n=1)
    return f" (did you mean {in_lower_case[nearest[0]]}?)" if nearest else ""


def shown(value: object, most: int | None = _LONGEST_SHOWN) -> str:
    """Return a value as printable text for a message, cut to a number of characters."""
    try:
        text = str(value)
    except (ValueError, RecursionError):  # an integer of thousands of digits
        return f"a {type(value).__name__} too large to print"
    short = text if most is None or len(text) <= most else text[:most] + "..."
    # An unpaired surrogate could not be printed.
    return "".join(
        c if c.isprintable() else c.encode("unicode_escape").decode() for c in short
    )
