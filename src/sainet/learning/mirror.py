"""Pushes seen in a mirror: disks on an even table know no left and right.

The push frame makes networks blind to where and which way a push goes, but not to its
handedness; showing each push as often mirrored as not teaches them that.
"""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool

from sainet.datasets.batch import PushBatch
from sainet.scenes.controls import Controls, PathControls
from sainet.scenes.state import State

_STREAM = 0x318808
_PLACE = (1.0, -1.0)
_POSE = (1.0, -1.0, -1.0)
_MOTION = (*_POSE, *_POSE)


def mirror_some(batch: PushBatch, seed: int, iteration: int) -> PushBatch:
    """Return the batch with about half of its pushes mirrored; drawn by the iteration.

    The field of friction of a scene, which is no known part of a stored push, stays.
    """
    rng = np.random.default_rng([_STREAM, seed, iteration])
    return mirror(batch, jnp.asarray(rng.random(batch.size) < 1 / 2))


def mirror(batch: PushBatch, chosen: Bool[Array, " push"]) -> PushBatch:
    """Return the batch with the chosen pushes mirrored at the x axis of the table."""

    def flip(values: Array, signs: tuple[float, ...] = ()) -> Array:
        behind = [1] * (values.ndim - 1)
        last = jnp.asarray(signs).reshape(1, *behind[1:], -1) if signs else -1.0
        return jnp.where(chosen.reshape(-1, *behind), values * last, values)

    start = batch.initial
    initial = State(
        position=flip(start.position, _PLACE),
        angle=flip(start.angle),
        velocity=flip(start.velocity, _PLACE),
        spin=flip(start.spin),
        pusher_position=flip(start.pusher_position, _PLACE),
        pusher_velocity=flip(start.pusher_velocity, _PLACE),
    )
    return eqx.tree_at(
        lambda b: (b.initial, b.controls, b.truth, b.measured, b.simulated),
        batch,
        (
            initial,
            _flipped(batch.controls, flip),
            flip(batch.truth, _MOTION),
            flip(batch.measured, _POSE),
            None if batch.simulated is None else flip(batch.simulated, _MOTION),
        ),
        is_leaf=lambda leaf: leaf is None,
    )


def _flipped(controls: Controls, flip) -> Controls:  # noqa: ANN001
    if isinstance(controls, PathControls):
        names = ("position", "velocity")
    else:
        names = ("force", "contact_offset")
    values = [flip(getattr(controls, name), _PLACE) for name in names]
    return eqx.tree_at(lambda c: [getattr(c, name) for name in names], controls, values)
