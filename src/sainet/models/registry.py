"""Models by name: physics alone, or the folder of a trained network."""

from dataclasses import dataclass, replace
from pathlib import Path

from sainet.engines import ASSUMED_ENGINES, make_assumed_engine, make_engine
from sainet.engines.assumed import AssumedProperties, calibrated
from sainet.errors import BadCheckpoint, UnknownName
from sainet.models.card import CARD, Card
from sainet.models.checkpoint import load_network
from sainet.models.dynamics import (
    AbstractDynamics,
    LearnedDynamics,
    PhysicsDynamics,
    SimulatorAugmented,
)
from sainet.models.restarted import Restarted

PHYSICS = {"physics": AssumedProperties, "physics-calibrated": calibrated}


@dataclass(frozen=True)
class NamedDynamics:
    """A model, what to call it in tables, and the card of its network if any."""

    name: str
    dynamics: AbstractDynamics
    card: Card | None = None
    folder: Path | None = None

    def check_fits(self, kind: str, time_step: float) -> None:
        """Raise `BadCheckpoint` if the network was trained for other pushes."""
        if self.card is None:
            return
        if self.card.kind != kind:
            raise BadCheckpoint(
                f"{self.folder}/{CARD}: kind is {self.card.kind!r}, the data's is "
                f"{kind!r}; train a network on such pushes, or give --force."
            )
        if abs(self.card.time_step - time_step) > 1e-9:  # noqa: PLR2004
            raise BadCheckpoint(
                f"{self.folder}/{CARD}: time_step is {self.card.time_step} s, the "
                f"data's is {time_step} s; train a network on such data, or give "
                "--force."
            )


def load_dynamics(name: str, *, engine: str = "planar") -> NamedDynamics:
    """Return a model by its name.

    Args:
        name: `physics`, `physics-calibrated`, or the folder of a trained network.
        engine: inside the physics models; a network's card names its own.

    Raises:
        UnknownName: neither a model nor a folder has this name.
        BadCheckpoint: the folder holds no network that can be used.
    """
    if name in PHYSICS:
        wrapped = PHYSICS[name](make_engine(engine))
        return NamedDynamics(name, PhysicsDynamics(wrapped))
    folder = Path(name)
    if not folder.exists():
        raise UnknownName(
            f"No model named {name!r}. Available: {', '.join(PHYSICS)}, or the folder "
            "of a trained network."
        )
    network, card = load_network(folder)
    if card.model == "in":
        dynamics: AbstractDynamics = LearnedDynamics(network)
    else:
        dynamics = SimulatorAugmented(network, _inner_engine(folder, card))
    if not card.recurrent:
        dynamics = Restarted(dynamics)
    return NamedDynamics(folder.name, dynamics, card, folder)


def _inner_engine(folder: Path, card: Card) -> AssumedProperties:
    if card.inner_engine not in ASSUMED_ENGINES:
        raise BadCheckpoint(
            f"{folder / CARD}: inner_engine is {card.inner_engine!r}; this sainet has "
            f"{', '.join(sorted(ASSUMED_ENGINES))}."
        )
    assumed = card.assumed or {}
    return replace(
        make_assumed_engine(card.inner_engine),
        mass=_tuple(assumed.get("mass")),
        radius=_tuple(assumed.get("radius")),
        friction=assumed.get("friction"),
    )


def _tuple(values: list[float] | None) -> tuple[float, ...] | None:
    return None if values is None else tuple(values)
