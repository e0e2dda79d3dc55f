"""A network that is shown more than the one that it goes on from."""

from dataclasses import replace

import equinox as eqx
import jax.numpy as jnp

from sainet.models.checkpoint import untrained
from sainet.models.interaction import InteractionNetwork, Scales


def widen(network: InteractionNetwork, scales: Scales) -> InteractionNetwork:
    """Return a network that also sees the place on the table, and says the same.

    What is new enters the first layer of f_dyn with weights of zero: it has no say
    until training gives it one.

    Args:
        network: of the paper's features.
        scales: of the new features, from the data that they are to be learned from;
            what the network knew already keeps its scales.
    """
    known, kept = network.sizes.body, network.scales
    weight = network.dyn.weights[0]
    added = scales.body_mean.shape[0] - known
    silent = jnp.zeros((added, weight.shape[1]), weight.dtype)
    # The features of the body come first, then the summed effects.
    wider = jnp.concatenate([weight[:known], silent, weight[known:]])
    dyn = eqx.tree_at(lambda layers: layers.weights[0], network.dyn, wider)
    mean = jnp.concatenate([kept.body_mean, scales.body_mean[known:]])
    deviation = jnp.concatenate([kept.body_deviation, scales.body_deviation[known:]])
    seen = eqx.tree_at(
        lambda s: (s.body_mean, s.body_deviation), kept, (mean, deviation)
    )
    sizes = replace(network.sizes, place=True)
    return eqx.tree_at(
        lambda n: (n.rel, n.dyn, n.scales),
        untrained(sizes, network.time_step, residual=network.residual),
        (network.rel, dyn, seen),
    )
