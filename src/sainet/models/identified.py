"""Identified parameters on disk, as written by `sainet identify`."""

from pathlib import Path
from typing import Any, Literal

import msgspec

from sainet.engines.simulator import InternalEngine
from sainet.runs.documents import read_document, read_json
from sainet.runs.errors import BadInput
from sainet.runs.folders import CONFIG, remake
from sainet.scenes.quantities import Finite, Size

FILE = "identified.json"
FORMAT = 2
_INTERNAL = ("engine", "format_version")


class Estimate(msgspec.Struct, frozen=True):
    """Estimate of one parameter."""

    name: str
    value: Finite  # the initial value where the parameter is not identifiable
    low: Finite  # of the 95 % interval
    high: Finite
    start: Finite  # initial value
    doubt: str | None = None  # why the parameter is not identifiable, if so


class Identified(msgspec.Struct, frozen=True, kw_only=True):
    """Parameters estimated from pushes, and how much they improve the engine."""

    engine: InternalEngine  # with the estimated parameters
    estimates: tuple[Estimate, ...]
    pushes: int
    before_mm: Size  # mean position error where poses were observed
    after_mm: Size
    before_deg: Size  # mean rotation error
    after_deg: Size
    format_version: Literal[2] = FORMAT

    def to_json(self) -> dict[str, Any]:
        """Return the estimates as JSON values, sorted by name."""
        found = msgspec.to_builtins(self, order="sorted") | {"values": self.values}
        return {name: found[name] for name in sorted(found) if name not in _INTERNAL}

    @property
    def values(self) -> dict[str, float]:
        """The estimated values by the names of their parameters."""
        pairs = sorted((estimate.name, estimate.value) for estimate in self.estimates)
        return dict(pairs)


def is_identified(folder: Path) -> bool:
    """Return whether a folder is from `sainet identify`, finished or not."""
    try:
        if (folder / FILE).is_file():
            return True
        return read_json(folder / CONFIG).get("command") == "identify"
    except (BadInput, OSError):  # missing or damaged: reading it raises the error
        return False


def read_identified(folder: Path) -> Identified:
    """Return the parameters that `sainet identify` estimated.

    Raises:
        BadInput: the file is missing, damaged or out of bounds.
    """
    path = folder / FILE
    if not path.is_file():
        raise BadInput(
            f"{path}: missing, so the identification is unfinished; run the same "
            "'sainet identify' again."
        )
    return read_document(path, Identified, remedy=remake(folder))
