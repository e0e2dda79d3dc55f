"""The card of a trained network: what it is, and what it was trained on."""

from dataclasses import asdict, dataclass, field, fields
from pathlib import Path
from typing import Any

from sainet.models.card_check import check_card
from sainet.runs.documents import FORMAT_VERSION, read_json
from sainet.runs.errors import BadCheckpoint

CARD = "card.json"
WEIGHTS = "network.safetensors"
# Fields that came later: what a card from before, which lacks them, means.
_LATER: dict[str, Any] = {
    "recurrent": True,
    "started_from": None,
    "earlier_seeds": [],
    "residual": False,
}


@dataclass(frozen=True, kw_only=True)
class Card:
    """Kept beside the weights; a network is not used outside of what it says."""

    model: str  # "in" or "sain"
    kind: str  # of the pushes: "robot" or "direct-force"
    time_step: float  # s
    inner_engine: str | None  # of SAIN; None for IN
    truth_engine: str  # that made the training data
    assumed: dict[str, Any] | None  # properties that the inner engine assumes
    data: str  # hash of the training data
    data_seed: int | None
    weights: str  # hash of the weights' file
    config: dict[str, Any]  # of the training
    manifest: dict[str, Any]  # versions, hardware, number of devices
    final_loss: float | None = None
    features: str = "paper"  # or "place"
    started_from: str | None = None  # hash of the weights that training began with
    earlier_seeds: list[int] = field(default_factory=list)  # of what that had seen
    recurrent: bool = True  # False: of single steps
    residual: bool = False  # True: its acceleration is added to the inner engine's
    format_version: int = field(default=FORMAT_VERSION)

    @property
    def data_seeds(self) -> list[int]:
        """The seeds of all simulated pushes that the network was ever trained on."""
        own = [] if self.data_seed is None else [self.data_seed]
        return [*self.earlier_seeds, *own]

    def to_dict(self) -> dict[str, Any]:
        """Return the card as JSON values."""
        return asdict(self)


def read_card(folder: Path) -> Card:
    """Read the card of a trained network.

    Raises:
        BadCheckpoint: it is missing, damaged or of a newer format.
    """
    path = folder / CARD
    if not folder.is_dir():
        raise BadCheckpoint(f"{folder}: no such network; make one with 'sainet train'.")
    if not path.is_file():
        raise BadCheckpoint(
            f"{path}: missing, so the training is unfinished or none; run the same "
            "'sainet train' again and it goes on."
        )
    found = read_json(path, BadCheckpoint)
    version = found.get("format_version")
    if not isinstance(version, int) or version > FORMAT_VERSION:
        raise BadCheckpoint(
            f"{path}: format_version is {version!r}, this sainet reads up to "
            f"{FORMAT_VERSION}; upgrade sainet."
        )
    names = {f.name for f in fields(Card)}
    for name, before in _LATER.items():
        found.setdefault(name, before)
    missing = sorted(names - found.keys())
    if missing:
        raise BadCheckpoint(f"{path}: {missing[0]} is missing; train it again.")
    check_card(path, found)
    return Card(**{name: found[name] for name in names})
