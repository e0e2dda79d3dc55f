"""Model cards: metadata stored with the weights of a network."""

from pathlib import Path
from typing import Any, Literal

import msgspec

from sainet.engines.simulator import InternalEngine
from sainet.models.identity import ModelId
from sainet.runs.documents import read_document
from sainet.runs.errors import BadCheckpoint
from sainet.scenes.camera import AGREES, CameraOffset
from sainet.scenes.quantities import TimeStep

CARD = "card.json"
WEIGHTS = "network.safetensors"
FORMAT = 2


class Card(msgspec.Struct, frozen=True, kw_only=True):
    """Metadata that restricts a network's use."""

    identity: ModelId
    kind: Literal["robot", "direct-force"]  # setup of the pushes
    time_step: TimeStep  # s
    truth_engine: str  # that made the training data, or "recorded"
    camera: CameraOffset = AGREES  # of the internal engine
    data: str  # hash of the training data
    data_seeds: tuple[int, ...] = ()  # of all simulated training pushes, oldest first
    pushes: str = ""  # all recorded training pushes (`runs.digests`)
    weights: str  # hash of the weights' file
    started_from: str | None = None  # hash of the weights that training began with
    recurrent: bool = True  # False: trained on single steps
    residual: bool = False  # True: adds to the internal engine's acceleration
    config: dict[str, Any]  # training settings
    manifest: dict[str, Any]  # versions, hardware, number of devices
    final_loss: float | None = None
    format_version: Literal[2] = FORMAT

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
