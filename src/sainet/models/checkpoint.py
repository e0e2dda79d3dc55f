"""Trained networks on disk: weights, a card, and the checks that they fit."""

from pathlib import Path

import equinox as eqx
import jax

from sainet.models.arrays import load_arrays
from sainet.models.card import CARD, WEIGHTS, Card, read_card
from sainet.models.correctors.interaction import InteractionNetwork
from sainet.models.features import FeatureSet, feature_set
from sainet.models.integrators import Acceleration, Integrator, RelaxingResidual
from sainet.runs.documents import content_hash, read_file
from sainet.runs.errors import BadCheckpoint


def load_network(folder: Path) -> tuple[InteractionNetwork, Card]:
    """Read a trained network and its card.

    Raises:
        BadCheckpoint: missing, damaged, of a newer format, or the two do not fit.
    """
    card = read_card(folder)
    augmented = card.identity.kind == "sain"
    place = card.identity.features == "place"
    features = feature_set(card.kind, simulator=augmented, place=place)
    integrator = RelaxingResidual() if card.residual else Acceleration()
    network = untrained(features, card.time_step, integrator)
    loaded = load_arrays(folder / WEIGHTS, network)
    if content_hash(read_file(folder / WEIGHTS, error=BadCheckpoint)) != card.weights:
        raise BadCheckpoint(
            f"{folder / CARD}: weights is another hash than that of "
            f"{WEIGHTS}; the two do not belong together, train the network again."
        )
    return loaded, card


def untrained(
    features: FeatureSet, time_step: float, integrator: Integrator
) -> InteractionNetwork:
    """Return a network of shapes instead of arrays: drawing arrays takes seconds."""

    def make() -> InteractionNetwork:
        return InteractionNetwork(
            features,
            time_step=time_step,
            key=jax.random.key(0),
            integrator=integrator,
        )

    return eqx.filter_eval_shape(make)
