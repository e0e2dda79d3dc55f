"""The push frame: the frame of the inputs and outputs of a network.

Its x axis is the contact normal, from the pusher to the pushed disk, at the start of
the push. Inputs are transformed into the frame and outputs back, so that translation,
rotation and permutation symmetry hold by construction.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from sainet.scenes.geometry import direction, rotate
from sainet.scenes.scene import Scene
from sainet.scenes.shapes import pusher_gaps
from sainet.scenes.state import State


class PushFrame(eqx.Module):
    """Push frames on the table, with the pushed disk of each."""

    origin: Float[Array, "*batch 2"]  # m, centre of the pushed disk
    angle: Float[Array, "*batch"]  # rad, of the contact normal
    pushed: Float[Array, "*batch body"]  # 1 for the pushed disk, 0 for the others


def push_frame(scene: Scene, state: State) -> PushFrame:
    """Return the frame of the pushed disk, the disk nearest to the pusher's surface."""
    nearest = jnp.argmin(pusher_gaps(scene, state), axis=-1)
    pushed = jax.nn.one_hot(nearest, scene.body_count, dtype=scene.mass.dtype)
    origin = jnp.sum(pushed[..., None] * state.position, axis=-2)
    return PushFrame(origin, direction(origin - state.pusher_position), pushed)


def motion_to_frame(
    motion: Float[Array, "*batch body 6"], frame: PushFrame
) -> Float[Array, "*batch body 6"]:
    """Return packed motion of the table frame in the push frame."""
    place = motion[..., 0:2] - frame.origin[..., None, :]
    return _turn(motion, place, -frame.angle)


def motion_from_frame(
    motion: Float[Array, "*batch body 6"], frame: PushFrame
) -> Float[Array, "*batch body 6"]:
    """Return packed motion of the push frame in the table frame."""
    back = _turn(motion, motion[..., 0:2], frame.angle)
    place = back[..., 0:2] + frame.origin[..., None, :]
    return jnp.concatenate([place, back[..., 2:]], axis=-1)


def _turn(motion: Array, place: Array, angle: Array) -> Array:
    parts = [
        rotate(place, angle[..., None]),
        motion[..., 2:3] + angle[..., None, None],
        rotate(motion[..., 3:5], angle[..., None]),
        motion[..., 5:6],
    ]
    return jnp.concatenate(parts, axis=-1)
