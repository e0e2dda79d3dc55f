"""Gaps between the surfaces of disks and pusher."""

import jax.numpy as jnp
from jaxtyping import Array, Float

from sainet.scenes.scene import Scene
from sainet.scenes.state import State


def pair_gaps(scene: Scene, state: State) -> Float[Array, "*batch body body"]:
    """Return the gaps between the surfaces of disks (m), negative for overlaps.

    The diagonal is infinite.
    """
    offset = state.position[..., :, None, :] - state.position[..., None, :, :]
    squared = jnp.sum(offset**2, axis=-1)
    itself = jnp.broadcast_to(jnp.eye(scene.body_count, dtype=bool), squared.shape)
    distance = jnp.sqrt(jnp.where(itself, 1.0, squared))
    reach = scene.radius[..., :, None] + scene.radius[..., None, :]
    return jnp.where(itself, jnp.inf, distance - reach)


def pusher_gaps(scene: Scene, state: State) -> Float[Array, "*batch body"]:
    """Return the gaps between the pusher and each disk (m), negative for overlaps."""
    offset = state.position - state.pusher_position[..., None, :]
    distance = jnp.sqrt(jnp.sum(offset**2, axis=-1))
    return distance - scene.radius - scene.pusher_radius[..., None]
