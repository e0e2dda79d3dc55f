"""Trained networks on disk: weights, a card, and the checks that they fit."""

from pathlib import Path

import equinox as eqx
import jax

from sainet.models.arrays import load_arrays
from sainet.models.card import CARD, WEIGHTS, Card, read_card
from sainet.models.features import FeatureSizes
from sainet.models.interaction import InteractionNetwork
from sainet.runs.documents import content_hash
from sainet.runs.errors import BadCheckpoint


def load_network(folder: Path) -> tuple[InteractionNetwork, Card]:
    """Read a trained network and its card.

    Raises:
        BadCheckpoint: missing, damaged, of a newer format, or the two do not fit.
    """
    card = read_card(folder)
    augmented, place = card.model == "sain", card.features == "place"
    sizes = FeatureSizes(card.kind, augmented, place)
    network = untrained(sizes, card.time_step, residual=card.residual)
    loaded = load_arrays(folder / WEIGHTS, network)
    if content_hash((folder / WEIGHTS).read_bytes()) != card.weights:
        raise BadCheckpoint(
            f"{folder / CARD}: weights is another hash than that of "
            f"{WEIGHTS}; the two do not belong together, train the network again."
        )
    return loaded, card


def untrained(
    sizes: FeatureSizes, time_step: float, *, residual: bool
) -> InteractionNetwork:
    """Return a network of shapes instead of arrays: drawing those takes seconds."""

    def make() -> InteractionNetwork:
        return InteractionNetwork(
            sizes, time_step=time_step, key=jax.random.key(0), residual=residual
        )

    return eqx.filter_eval_shape(make)
