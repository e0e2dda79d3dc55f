"""Ensembles on disk: a document with the calibration, beside the folders of members."""

from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

import jax.numpy as jnp
import msgspec

from sainet.models.card import Card
from sainet.models.checkpoint import load_network
from sainet.models.correctors.network import AbstractNetwork
from sainet.models.ensemble import Calibration, stacked
from sainet.runs.documents import read_document
from sainet.runs.errors import BadCheckpoint
from sainet.scenes.quantities import Finite

ENSEMBLE = "ensemble.json"
MEMBERS = (2, 20)
_Positive = Annotated[float, msgspec.Meta(gt=0, le=1e6)]
Pair = tuple[_Positive, _Positive]  # of position (m) and rotation (rad)


class EnsembleCard(msgspec.Struct, frozen=True, kw_only=True):
    """The members, by the hashes of their weights, and how regions are made of them."""

    file: ClassVar[str] = ENSEMBLE
    noun: ClassVar[str] = "ensemble"

    members: Annotated[
        tuple[str, ...], msgspec.Meta(min_length=MEMBERS[0], max_length=MEMBERS[1])
    ]
    floor: tuple[Pair, ...]  # body by body, as in `Calibration`
    reach: tuple[Pair, ...]
    plain: tuple[Pair, ...]
    calibrated_on: Annotated[int, msgspec.Meta(ge=1)]  # pushes that no member saw
    pushes: str  # all, by `runs.digests`: of members and of the calibration
    final_loss: Finite | None = None
    seal: str = ""  # hash of all other fields
    format_version: Literal[1] = 1

    def __post_init__(self) -> None:
        """Refuse calibrations of different numbers of bodies."""
        if not 1 <= len(self.floor) == len(self.reach) == len(self.plain):
            raise ValueError("floor, reach and plain differ in their numbers of disks")

    @property
    def calibration(self) -> Calibration:
        """The calibration as arrays."""
        each = (self.floor, self.reach, self.plain)
        return Calibration(*(jnp.array(values, jnp.float32) for values in each))


class JointCard(Card, frozen=True, kw_only=True):
    """What the cards of all members have in common."""

    file: ClassVar[str] = ENSEMBLE
    noun: ClassVar[str] = "ensemble"


def is_ensemble(folder: Path) -> bool:
    """Return whether a folder holds a finished ensemble."""
    return (folder / ENSEMBLE).is_file()


def member(folder: Path, number: int) -> Path:
    """Return the folder of a member, counted from 0."""
    return folder / f"member-{number}"


def load_ensemble(folder: Path) -> tuple[AbstractNetwork, Card, EnsembleCard]:
    """Read the members, stacked, their common card, and the card of the ensemble.

    Raises:
        BadCheckpoint: a file is missing or damaged, or a member is another network.
    """
    path = folder / ENSEMBLE
    found = read_document(
        path, EnsembleCard, error=BadCheckpoint, remedy="train it again"
    )
    loaded = [load_network(member(folder, n)) for n in range(len(found.members))]
    for number, ((_, card), weights) in enumerate(
        zip(loaded, found.members, strict=True)
    ):
        if card.weights != weights:
            raise BadCheckpoint(
                f"{path}: members[{number}] is not the hash of the weights in "
                f"{member(folder, number)}; train the ensemble again."
            )
    card = loaded[0][1]
    if len(found.reach) != card.disks:
        raise BadCheckpoint(
            f"{path}: reach is of {len(found.reach)} disk(s), the members of "
            f"{card.disks}; train the ensemble again."
        )
    identity = msgspec.structs.replace(card.identity, variant="ensemble")
    fields: Any = {name: getattr(card, name) for name in card.__struct_fields__}
    fields |= {"identity": identity, "pushes": found.pushes}
    joint = JointCard(**fields | {"final_loss": found.final_loss})
    return stacked([network for network, _ in loaded]), joint, found
