"""Trained networks on disk: weights, a card, and the checks that they fit."""

from pathlib import Path

import jax

from sainet.errors import BadCheckpoint
from sainet.models.arrays import load_arrays
from sainet.models.card import CARD, WEIGHTS, Card, read_card
from sainet.models.features import ACTION_SIZE, FeatureSizes
from sainet.models.interaction import InteractionNetwork
from sainet.runs import content_hash


def load_network(folder: Path) -> tuple[InteractionNetwork, Card]:
    """Read a trained network and its card.

    Raises:
        BadCheckpoint: missing, damaged, of a newer format, or the two do not fit.
    """
    card = read_card(folder)
    network = untrained(_sizes(folder, card), card.time_step)
    loaded = load_arrays(folder / WEIGHTS, network)
    if content_hash((folder / WEIGHTS).read_bytes()) != card.weights:
        raise BadCheckpoint(
            f"{folder / CARD}: weights is another hash than that of "
            f"{WEIGHTS}; the two do not belong together, train the network again."
        )
    return loaded, card


def _sizes(folder: Path, card: Card) -> FeatureSizes:
    if card.model not in ("in", "sain"):
        raise BadCheckpoint(
            f"{folder / CARD}: model is {card.model!r}; it must be 'in' or 'sain'."
        )
    if card.kind not in ACTION_SIZE:
        raise BadCheckpoint(
            f"{folder / CARD}: kind is {card.kind!r}; it must be one of "
            f"{', '.join(ACTION_SIZE)}."
        )
    if not isinstance(card.time_step, float) or not 0 < card.time_step < 1:
        raise BadCheckpoint(
            f"{folder / CARD}: time_step is {card.time_step!r}; it must be in seconds, "
            "between 0 and 1."
        )
    return FeatureSizes(card.kind, card.model == "sain")


def untrained(sizes: FeatureSizes, time_step: float) -> InteractionNetwork:
    """Return a network whose arrays are to be replaced."""
    return InteractionNetwork(sizes, time_step=time_step, key=jax.random.key(0))
