"""Networks with more features than the network that training continues."""

import equinox as eqx
import jax.numpy as jnp

from sainet.models.checkpoint import untrained
from sainet.models.correctors.interaction import InteractionNetwork, Scales
from sainet.models.features import FeatureSet, Place


def widen(network: InteractionNetwork, scales: Scales) -> InteractionNetwork:
    """Return a network that also takes the place on the table; its output is equal.

    The new features enter the first layer of f_dyn with weights of zero: they have no
    effect until training changes that.

    Args:
        network: with the paper's features.
        scales: of the new features, from the training data; the other features keep
            their scales.
    """
    known, kept = network.features.body_size, network.scales
    weight = network.dyn.weights[0]
    added = scales.body_mean.shape[0] - known
    silent = jnp.zeros((added, weight.shape[1]), weight.dtype)
    # The features of the body come first, then the summed effects.
    wider = jnp.concatenate([weight[:known], silent, weight[known:]])
    dyn = eqx.tree_at(lambda layers: layers.weights[0], network.dyn, wider)
    mean = jnp.concatenate([kept.body_mean, scales.body_mean[known:]])
    deviation = jnp.concatenate([kept.body_deviation, scales.body_deviation[known:]])
    widened = eqx.tree_at(
        lambda s: (s.body_mean, s.body_deviation), kept, (mean, deviation)
    )
    features = FeatureSet((*network.features.blocks, Place()))
    return eqx.tree_at(
        lambda n: (n.rel, n.dyn, n.scales),
        untrained(features, network.time_step, network.integrator),
        (network.rel, dyn, widened),
    )
