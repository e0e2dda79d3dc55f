"""One gradient step, compiled once: the batch is split over all devices."""

from collections.abc import Callable
from functools import partial

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import lax
from jax.flatten_util import ravel_pytree
from jax.sharding import NamedSharding, PartitionSpec
from jaxtyping import Array

from sainet.datasets.batch import PushBatch
from sainet.engines.devices import BATCH, batch_mesh, is_one_gpu
from sainet.learning.batches import predict_batch
from sainet.learning.loss import LossWeights, push_losses, to_target
from sainet.learning.recipes import Optimiser, Recipe
from sainet.learning.state import (
    FitState,
    Trained,
    trained_layers,
    update,
    with_layers,
)
from sainet.models.correctors.network import AbstractNetwork

_MICROBATCH = 500  # pushes at a time: 20,000 single steps would leave the cache


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
        pushes = jnp.sum(batch.is_observed)
        after = update(state, start, summed, pushes, optimiser=optimiser, l2=l2)
        return after, total / pushes

    return step


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
    pushes = jnp.sum(batch.is_observed)
    after = update(
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
