"""Stored batches as training uses them: predictions and targets in the push frame."""

from functools import partial

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from sainet.datasets.batch import PushBatch
from sainet.learning.held import unroll_held
from sainet.learning.loss import Target
from sainet.models.correctors.base import Start
from sainet.models.correctors.interaction import InteractionNetwork, unroll
from sainet.models.frame import PushFrame, motion_to_frame, push_frame
from sainet.models.integrators import RelaxingResidual


def predict_batch(
    network: InteractionNetwork, batch: PushBatch, hold: int = 1
) -> Float[Array, "time push body 6"]:
    """Predict each push recurrently from its start, with the stored s-bar (eq. 1).

    Args:
        network: IN or SAIN.
        batch: of pushes, with s-bar for SAIN.
        hold: length of the zero-order hold of an additive network (steps).
    """
    is_held = isinstance(network.integrator, RelaxingResidual) and hold > 1
    initial, has_simulator = batch.initial, network.features.has_simulator
    frame = push_frame(batch.scene, initial)
    return network.in_frame(
        batch.scene,
        Start(initial, frame, initial if has_simulator else None),
        batch.controls,
        batch.simulated if has_simulator else None,
        unroll=partial(unroll_held, hold=hold) if is_held else unroll,
    )


def to_target(batch: PushBatch) -> Target:
    """Return the observed motion: measured poses, velocities of the ground truth."""
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
