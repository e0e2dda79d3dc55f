"""A stored batch as a network trains on it: everything in the push frame."""

from functools import partial

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from sainet.datasets.batch import PushBatch
from sainet.learning.held import unroll_held
from sainet.learning.loss import Target
from sainet.models.dynamics import LearnedCarry, predict_motion
from sainet.models.frame import PushFrame, motion_to_frame, push_frame
from sainet.models.interaction import InteractionNetwork, unroll
from sainet.scenes.state import pack_motion


def predict_batch(
    network: InteractionNetwork, batch: PushBatch, hold: int = 1
) -> Float[Array, "time push body 6"]:
    """Predict each push recurrently from its start, with the stored s-bar (eq. 1).

    Args:
        network: IN or SAIN.
        batch: of pushes, with s-bar if it is SAIN.
        hold: steps over which what a residual network says is held.
    """
    is_held = network.residual and hold > 1
    carry = LearnedCarry(batch.initial, push_frame(batch.scene, batch.initial))
    start = pack_motion(batch.initial) if network.sizes.augmented else None
    simulated = batch.simulated if network.sizes.augmented else None
    return predict_motion(
        network,
        batch.scene,
        carry,
        batch.controls,
        simulated_start=start,
        simulated=simulated,
        unroll=partial(unroll_held, hold=hold) if is_held else unroll,
    )


def to_target(batch: PushBatch) -> Target:
    """Return what was observed: measured poses, velocities of the truth."""
    frame = push_frame(batch.scene, batch.initial)
    motion = jnp.concatenate([batch.measured, batch.truth[..., 3:6]], axis=-1)
    local = path_to_frame(motion, frame)
    return Target(
        pose=local[..., 0:3],
        rate=local[..., 3:6],
        pose_observed=batch.pose_observed.T,
        rate_observed=batch.rate_observed.T,
    )


def path_to_frame(
    motion: Float[Array, "push time body 6"], frame: PushFrame
) -> Float[Array, "time push body 6"]:
    """Turn packed motion over time into the push frame, time first."""
    return jax.vmap(motion_to_frame, in_axes=(1, None))(motion, frame)
