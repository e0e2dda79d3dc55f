"""One gradient step, compiled once: the batch is split over all devices."""

from collections.abc import Callable
from functools import partial
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import optax
from jax import lax
from jax.flatten_util import ravel_pytree
from jax.sharding import NamedSharding, PartitionSpec
from jaxtyping import Array

from sainet.datasets.batch import PushBatch
from sainet.engines.devices import BATCH, batch_mesh, is_one_gpu
from sainet.learning.batches import predict_batch
from sainet.learning.loss import LossWeights, push_losses, to_target
from sainet.learning.recipes import Optimiser, Recipe
from sainet.models.correctors.network import AbstractNetwork

_MOST_BAD_STEPS = 100  # in a row, before non-finite updates are let through
_MICROBATCH = 500  # pushes at a time: 20,000 single steps would leave the cache

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
def _update(
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


def data_loss(
    network: AbstractNetwork, batch: PushBatch, weights: LossWeights, hold: int = 1
) -> Array:
    """Return the sum of the losses of the pushes of a batch (see `predict_batch`)."""
    predicted = predict_batch(network, batch, hold)
    return jnp.sum(push_losses(predicted, to_target(batch), weights))


def make_gradient(
    weights: LossWeights, hold: int = 1
) -> Callable[[AbstractNetwork, PushBatch], tuple[Array, Trained]]:
    """Return a function that sums loss and gradient over a batch on all devices.

    The sums of the devices are added outside of the compiled function. XLA's all-reduce
    blocks a thread of the pool that the other device works with; on two busy cores it
    waited for itself until it aborted the process.

    The time of a transfer between devices depends on the number of arrays, not on their
    size: networks and gradients are one array each. Batches are transferred through the
    host, which does not copy them.
    """
    everywhere = NamedSharding(batch_mesh(), PartitionSpec())
    parts = NamedSharding(batch_mesh(), PartitionSpec(BATCH))
    weights = jax.device_put(weights, everywhere)

    def gradient(network: AbstractNetwork, batch: PushBatch) -> tuple[Array, Trained]:
        numbers, to_network = ravel_pytree(network)
        numbers = jax.device_put(numbers, everywhere)
        batch = jax.device_put(jax.device_get(batch), parts)
        sums = _sum_on_devices(
            weights, numbers, batch, to_network=to_network, hold=hold
        )
        return _total(jax.device_put(sums, jax.devices()[0]), trained_layers(network))

    return gradient


# Compiled once for each set of shapes, whatever the weights, seed and settings are.
@partial(jax.jit, static_argnames=("to_network", "hold"))
def _sum_on_devices(
    weights: LossWeights,
    numbers: Array,
    batch: PushBatch,
    *,
    to_network: Callable[[Array], AbstractNetwork],
    hold: int,
) -> tuple[Array, Array]:
    """Return losses ``[part]`` and gradients ``[part number]`` of all devices."""

    def of_part(
        weights: LossWeights, numbers: Array, batch: PushBatch
    ) -> tuple[Array, Array]:
        return _sum_of_part(weights, to_network(numbers), batch, hold)

    split = jax.shard_map(
        of_part,
        mesh=batch_mesh(),
        in_specs=(PartitionSpec(), PartitionSpec(), PartitionSpec(BATCH)),
        out_specs=PartitionSpec(BATCH),
        check_vma=False,
    )
    return split(weights, numbers, batch)


def _sum_of_part(
    weights: LossWeights, network: AbstractNetwork, batch: PushBatch, hold: int
) -> tuple[Array, Array]:
    """Return losses ``[part]`` and gradients ``[part number]`` of a device."""

    def loss(layers: Trained, part: PushBatch) -> Array:
        return data_loss(with_layers(network, layers), part, weights, hold)

    def gradient(part: PushBatch) -> tuple[Array, Array]:
        found, layers = jax.value_and_grad(loss)(trained_layers(network), part)
        return found, ravel_pytree(layers)[0]

    count = _microbatch_count(batch.size)
    parts = jax.tree.map(lambda x: x.reshape(count, -1, *x.shape[1:]), batch)
    return lax.map(gradient, parts)


def _microbatch_count(pushes: int) -> int:
    return -(-pushes // _MICROBATCH)


@jax.jit
def _total(sums: tuple[Array, Array], layers: Trained) -> tuple[Array, Trained]:
    """Return the sum over all microbatches; the gradient has the form of the layers."""
    losses, rows = sums
    to_layers = ravel_pytree(layers)[1]
    return jnp.sum(losses), to_layers(jnp.sum(rows, axis=0))


def make_step(
    recipe: Recipe, weights: LossWeights, start: Trained | None = None
) -> Callable[[FitState, PushBatch], tuple[FitState, Array]]:
    """Return the gradient step; its parts are compiled.

    Args:
        recipe: with a number for l2, see `Objective.for_pushes`.
        weights: of the loss.
        start: layers that l2 draws towards; None is zero.

    Returns:
        A function of the state, on the first device, and of a batch that `even_batch`
        filled up. It returns the next state and the mean loss of the pushes without l2.
    """
    if recipe.objective.l2 is None:
        raise ValueError("l2 is None; call Objective.for_pushes first")
    optimiser, l2, hold = recipe.optimiser, recipe.objective.l2, recipe.horizon.hold
    if is_one_gpu():
        return lambda state, batch: step_in_one(
            optimiser, hold, Side(state, batch, weights, start, jnp.float32(l2))
        )
    gradient = make_gradient(weights, hold)

    def step(state: FitState, batch: PushBatch) -> tuple[FitState, Array]:
        total, summed = gradient(state.network, batch)
        pushes = _observed(batch)
        after = _update(state, start, summed, pushes, optimiser=optimiser, l2=l2)
        return after, total / pushes

    return step


def _observed(batch: PushBatch) -> Array:
    """Return the number of observed pushes, by which sums are divided: at least 1."""
    return jnp.maximum(jnp.sum(batch.is_observed), 1)


class Side(eqx.Module):
    """What a step of a network takes: its state and batch, and its own settings."""

    state: FitState
    batch: PushBatch
    weights: LossWeights
    start: Trained | None  # layers that l2 draws towards
    l2: Array


@partial(jax.jit, static_argnums=(0, 1))
def step_in_one(optimiser: Optimiser, hold: int, side: Side) -> tuple[FitState, Array]:
    """Take a step in one program, so that a GPU never waits for the processor.

    Returns:
        The next state and the mean loss of the pushes without l2.
    """
    network, batch = side.state.network, side.batch

    def loss(layers: Trained) -> Array:
        return data_loss(with_layers(network, layers), batch, side.weights, hold)

    total, summed = jax.value_and_grad(loss)(trained_layers(network))
    pushes = _observed(batch)
    after = _update(
        side.state, side.start, summed, pushes, optimiser=optimiser, l2=side.l2
    )
    return after, total / pushes


@partial(jax.jit, static_argnums=(0, 1))
def step_together(
    optimiser: Optimiser, hold: int, sides: tuple[Side, ...]
) -> tuple[tuple[FitState, Array], ...]:
    """Return what `step_in_one` returns for each of several networks."""
    one = jax.tree.map(lambda *parts: jnp.stack(parts), *sides)
    after = jax.vmap(partial(step_in_one, optimiser, hold))(one)
    return tuple(jax.tree.map(lambda x, i=i: x[i], after) for i in range(len(sides)))


def even_batch(batch: PushBatch) -> PushBatch:
    """Repeat the last push, unobserved, until all microbatches have one size."""
    devices = jax.device_count()
    extra = -batch.size % (devices * _microbatch_count(-(-batch.size // devices)))
    if not extra:
        return batch
    padded = jax.tree.map(
        lambda x: jnp.concatenate([x, jnp.repeat(x[-1:], extra, axis=0)]), batch
    )
    real = jnp.arange(batch.size + extra) < batch.size
    return eqx.tree_at(
        lambda b: (b.pose_observed, b.rate_observed),
        padded,
        (padded.pose_observed & real[:, None], padded.rate_observed & real[:, None]),
    )
