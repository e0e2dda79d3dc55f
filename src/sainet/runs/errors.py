"""The few errors of the package: each message is one line that names the way out."""


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
    """Somebody else's file of recorded pushes that cannot be read."""


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


def require_option(condition: bool, name: str, wanted: str, value: object) -> None:
    """Raise `BadInput` for the command-line option that set a value, if it is bad."""
    if not condition:
        option = "--" + name.replace("_", "-")
        raise BadInput(f"{option} is {value}; it must be {wanted}.")
