"""Means over where a model expects disks to end, by sigma points."""

from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from sainet.models.correctors import CONFIDENCE, Region
from sainet.scenes.geometry import rotate
from sainet.scenes.state import State

# Half axes of the ellipse that holds `CONFIDENCE` of a normal distribution of the
# plane, in standard deviations.
_REACH = float(np.sqrt(-2 * np.log(1 - CONFIDENCE)))


def mean_over(
    region: Region, value: Callable[[State], Float[Array, " push"]], end: State
) -> Float[Array, " push"]:
    """Return the mean of a function of the final state.

    The distribution of positions is normal, with the ellipses of the regions; angles
    stay as predicted. Unscented transform (Julier and Uhlmann, 1997): the function is
    evaluated at points that have the same mean and covariance.

    Args:
        region: about the end of each push.
        value: of the states of all pushes.
        end: predicted, at rest.
    """
    bodies = end.position.shape[-2]
    size = 2 * bodies
    axes = region.axes / _REACH * jnp.sqrt(1.0 * size)  # [push, body, 2]
    chosen = jnp.eye(size).reshape(size, bodies, 2)
    signed = jnp.concatenate([chosen, -chosen])  # one coordinate each
    turn = region.heading[:, None]

    def at(direction: Float[Array, "body 2"]) -> Float[Array, " push"]:
        offset = rotate(axes * direction[None], turn)
        moved = eqx.tree_at(lambda s: s.position, end, end.position + offset)
        return value(moved)

    return jnp.mean(jax.vmap(at)(signed), axis=0)
