"""The state of a training run: its network, and what the optimiser remembers."""

from functools import partial
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import optax
from jaxtyping import Array, Float, Int

from sainet.learning.recipes import Optimiser
from sainet.models.correctors.network import AbstractNetwork

_MOST_BAD_STEPS = 100  # in a row, before non-finite updates are let through

Trained = Any  # tuple[Layers, Layers]: a tree, which Optax's types do not know


class FitState(eqx.Module):
    """Everything that changes while training: enough to resume, bit for bit."""

    network: AbstractNetwork
    optimizer: Any
    iteration: Array
    average: Trained | None = None  # of the layers, if the recipe averages

    @property
    def result(self) -> AbstractNetwork:
        """The network with which training would end now."""
        if self.average is None:
            return self.network
        return with_layers(self.network, self.average)


def make_optimizer(optimiser: Optimiser) -> optax.GradientTransformation:
    """Return Adam with a falling learning rate, guarded against exploding steps."""
    schedule = _schedule(optimiser)
    chain = optax.chain(
        optax.clip_by_global_norm(optimiser.clip_norm), optax.adam(schedule)
    )
    return optax.apply_if_finite(chain, _MOST_BAD_STEPS)


def _schedule(optimiser: Optimiser) -> optax.Schedule:
    """Return the learning rate by the number of iterations so far."""
    first = optimiser.learning_rate
    if optimiser.decay == "cosine":
        return optax.cosine_decay_schedule(first, optimiser.iterations)
    return optax.exponential_decay(first, optimiser.halve_every, 0.5, staircase=True)


def trained_layers(network: AbstractNetwork) -> Trained:
    """Return the part of a network that is trained: all except its scales."""
    return network.trained


def with_layers(network: AbstractNetwork, layers: Trained) -> AbstractNetwork:
    """Return the network with other weights."""
    return eqx.tree_at(trained_layers, network, layers)


def first_state(network: AbstractNetwork, optimiser: Optimiser) -> FitState:
    """Return the state before the first iteration."""
    layers = trained_layers(network)
    moments = make_optimizer(optimiser).init(layers)
    average = layers if optimiser.average else None
    return FitState(network, moments, jnp.zeros((), jnp.int32), average)


def _averaged(average: Trained, layers: Trained, span: int, done: Array) -> Trained:
    """Return the exponential mean, over a shorter span in the first iterations.

    The first weights must not stay in it for long: the share of the new weights is that
    of TensorFlow's `ExponentialMovingAverage` with `num_updates`.
    """
    share = jnp.maximum(1 / span, 9 / (10 + done))
    return optax.incremental_update(layers, average, share)


# Compiled once for each optimiser, for any number of networks.
@partial(jax.jit, static_argnames=("optimiser",))
def update(
    state: FitState,
    start: Trained | None,
    summed: Trained,
    pushes: Array,
    *,
    optimiser: Optimiser,
    l2: float | Array,
) -> FitState:
    """Take Adam's step along the mean gradient of so many pushes, l2 added."""
    layers = trained_layers(state.network)
    change = layers if start is None else jax.tree.map(jnp.subtract, layers, start)
    mean = jax.tree.map(lambda g, w: g / pushes + 2 * l2 * w, summed, change)
    updates, moments = make_optimizer(optimiser).update(mean, state.optimizer, layers)
    layers = optax.apply_updates(layers, updates)
    average = state.average
    if average is not None:
        average = _averaged(average, layers, optimiser.average, state.iteration)
    network = with_layers(state.network, layers)
    return FitState(network, moments, state.iteration + 1, average)


class Best(eqx.Module):
    """Its layers, and when and how good it was; part of a checkpoint."""

    layers: Trained
    loss: Float[Array, ""]  # on the validation pushes
    iteration: Int[Array, ""]

    @staticmethod
    def first(network: AbstractNetwork, loss: float) -> "Best":
        """Return the network that training begins with: it may remain the best."""
        return Best(trained_layers(network), jnp.float32(loss), jnp.int32(0))

    def or_better(
        self, network: AbstractNetwork, loss: float, iteration: int
    ) -> "Best":
        """Return the better one of this and another network."""
        if not loss < float(self.loss):
            return self
        return Best(trained_layers(network), jnp.float32(loss), jnp.int32(iteration))

    def is_stale(self, iteration: int, patience: int) -> bool:
        """Return whether nothing has become better for so many iterations."""
        return 0 < patience <= iteration - int(self.iteration)

    def put_into(self, network: AbstractNetwork) -> AbstractNetwork:
        """Return the network with the best layers."""
        return with_layers(network, self.layers)
