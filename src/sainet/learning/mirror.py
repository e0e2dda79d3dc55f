"""Mirrored pushes: disks on an even table move alike to the left and to the right.

The push frame makes networks insensitive to where and in which direction a push goes,
but not to its handedness; training on each push as often mirrored as not teaches that.
"""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool

from sainet.datasets.batch import PushBatch

_STREAM = 0x318808
_POSE = (1.0, -1.0, -1.0)


def mirror_some(batch: PushBatch, seed: int, iteration: int) -> PushBatch:
    """Return the batch with about half of its pushes mirrored; drawn by the iteration.

    Scenes stay: a stored push has no field of friction.
    """
    rng = np.random.default_rng([_STREAM, seed, iteration])
    return mirror(batch, jnp.asarray(rng.random(batch.size) < 1 / 2))


def mirror(batch: PushBatch, chosen: Bool[Array, " push"]) -> PushBatch:
    """Return the batch with the chosen pushes mirrored at the x axis of the table."""

    def flip(values: Array) -> Array:
        poses = np.resize(_POSE, values.shape[-1])  # and their rates, if packed motion
        return values * poses.astype(values.dtype).reshape(
            (1,) * (values.ndim - 1) + (-1,)
        )

    def choose(mirrored: Array, values: Array) -> Array:
        return jnp.where(chosen.reshape(-1, *[1] * (values.ndim - 1)), mirrored, values)

    known = batch.initial, batch.controls, batch.truth, batch.measured, batch.simulated
    mirrored = (
        batch.initial.mirrored(),
        batch.controls.mirrored(),
        *jax.tree.map(flip, known[2:]),
    )
    initial, controls, truth, measured, simulated = jax.tree.map(
        choose, mirrored, known
    )
    return replace(
        batch,
        initial=initial,
        controls=controls,
        truth=truth,
        measured=measured,
        simulated=simulated,
    )
