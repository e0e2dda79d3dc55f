"""Documents of models: cards of networks, and identified parameters."""

from pathlib import Path
from typing import Any, Literal

import msgspec

from sainet.engines.simulator import InternalEngine
from sainet.models.identity import ModelId
from sainet.runs.documents import read_document, read_json
from sainet.runs.errors import BadCheckpoint, BadInput
from sainet.runs.folders import CONFIG, remake
from sainet.scenes.camera import AGREES, CameraOffset
from sainet.scenes.quantities import Finite, Size, TimeStep

CARD = "card.json"
WEIGHTS = "network.safetensors"


class Card(msgspec.Struct, frozen=True, kw_only=True):
    """Metadata that restricts a network's use."""

    identity: ModelId
    kind: Literal["robot", "direct-force"]  # setup of the pushes
    time_step: TimeStep  # s
    truth_engine: str  # that made the training data, or "recorded"
    camera: CameraOffset = AGREES  # of the internal engine
    data: str  # hash of the training data
    data_seeds: tuple[int, ...] = ()  # of simulated training pushes not in `pushes`
    pushes: str = ""  # training pushes (`runs.digests`)
    weights: str  # hash of the weights' file
    started_from: str | None = None  # hash of the weights that training began with
    recurrent: bool = True  # False: trained on single steps
    residual: bool = False  # True: adds to the internal engine's acceleration
    config: dict[str, Any]  # training settings
    manifest: dict[str, Any]  # versions, hardware, number of devices
    final_loss: float | None = None
    format_version: Literal[2] = 2

    def __post_init__(self) -> None:
        """Refuse identities that no network can have."""
        kind, simulator = self.identity.kind, self.identity.simulator
        if kind not in ("in", "sain"):
            raise ValueError(f"identity.kind is {kind!r}; it must be 'in' or 'sain'")
        if (simulator is None) != (kind == "in"):
            raise ValueError("identity.simulator is missing, or there is one for 'in'")
        if self.residual and kind != "sain":
            raise ValueError("residual is true; identity.kind must then be 'sain'")

    @property
    def internal(self) -> InternalEngine | None:
        """The internal engine; None for a network without one."""
        simulator = self.identity.simulator
        return None if simulator is None else InternalEngine(simulator, self.camera)


def read_card(folder: Path) -> Card:
    """Read the card of a trained network.

    Raises:
        BadCheckpoint: it is missing, damaged, out of bounds or of another format.
    """
    path = folder / CARD
    if not folder.is_dir():
        raise BadCheckpoint(f"{folder}: no such network; make one with 'sainet train'.")
    if not path.is_file():
        raise BadCheckpoint(
            f"{path}: not found: training did not finish; run the same command again "
            "to resume it."
        )
    return read_document(path, Card, error=BadCheckpoint, remedy="train it again")


IDENTIFIED = "identified.json"
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
    format_version: Literal[2] = 2

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
        if (folder / IDENTIFIED).is_file():
            return True
        return read_json(folder / CONFIG).get("command") == "identify"
    except (BadInput, OSError):  # missing or damaged: reading it raises the error
        return False


def read_identified(folder: Path) -> Identified:
    """Return the parameters that `sainet identify` estimated.

    Raises:
        BadInput: the file is missing, damaged or out of bounds.
    """
    path = folder / IDENTIFIED
    if not path.is_file():
        raise BadInput(
            f"{path}: missing, so the identification is unfinished; run the same "
            "'sainet identify' again."
        )
    return read_document(path, Identified, remedy=remake(folder))
