"""Computation on batches, split over all JAX devices."""

from collections.abc import Callable
from functools import lru_cache
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jax.sharding import AxisType, Mesh, PartitionSpec

BATCH = "batch"  # name of the mesh axis over which batches are sharded


@lru_cache
def batch_mesh() -> Mesh:
    """Return a mesh of all devices along one axis, `BATCH`."""
    return jax.make_mesh((jax.device_count(),), (BATCH,), axis_types=(AxisType.Auto,))


def is_one_gpu() -> bool:
    """Return whether JAX computes on a single GPU."""
    return jax.default_backend() == "gpu" and jax.device_count() == 1


@eqx.filter_jit
def over_devices(
    function: Callable[..., Any],
    shared: Any,  # noqa: ANN401
    *batched: Any,  # noqa: ANN401
    most: int | None = None,
) -> Any:  # noqa: ANN401
    """Return ``function(shared, *batched)``, with the batch split over all devices.

    Args:
        function: accepts any batch size; compiled once per set of shapes.
        shared: tree that is copied to every device.
        batched: trees of arrays whose first axis is the batch.
        most: rows per device at a time, so that intermediate arrays stay in its cache;
            None for all rows.

    Returns:
        The result of the function; the first axis of its arrays is the batch.
    """
    arrays, static = eqx.partition((shared, batched), eqx.is_array)
    size = jax.tree.leaves(arrays[1])[0].shape[0]
    devices = jax.device_count()
    rounds = -(-size // (devices * (most or size)))
    padding = -size % (devices * rounds)
    arrays = (arrays[0], jax.tree.map(lambda x: _pad(x, padding), arrays[1]))

    def local(shared: Any, batched: Any) -> Any:  # noqa: ANN401
        def once(part: Any) -> Any:  # noqa: ANN401
            whole, rows = eqx.combine((shared, part), static)
            return function(whole, *rows)

        if rounds == 1:
            return once(batched)
        parts = jax.tree.map(lambda x: x.reshape(rounds, -1, *x.shape[1:]), batched)
        found = jax.lax.map(once, parts)
        return jax.tree.map(lambda x: x.reshape(-1, *x.shape[2:]), found)

    sharded = jax.shard_map(
        local,
        mesh=batch_mesh(),
        in_specs=(PartitionSpec(), PartitionSpec(BATCH)),
        out_specs=PartitionSpec(BATCH),
        check_vma=False,
    )
    return jax.tree.map(lambda x: x[:size], sharded(*arrays))


def _pad(array: jax.Array, padding: int) -> jax.Array:
    # Repeat the last row: zeros would be impossible scenes.
    if not padding:
        return array
    tail = jnp.repeat(array[-1:], padding, axis=0)
    return jnp.concatenate([array, tail])
