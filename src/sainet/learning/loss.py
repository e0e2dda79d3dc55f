"""The loss of predicted pushes, with the scales of all terms from the data."""

from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from sainet.datasets.batch import PushBatch
from sainet.learning.recipes import Objective
from sainet.models.correctors.network import Scales
from sainet.models.features import AbstractFeatures, Signs
from sainet.models.inputs import (
    Drive,
    Moment,
    PushFrame,
    drives,
    in_columns,
    motion_to_frame,
    push_frame,
)
from sainet.models.integrators import Acceleration, Integrator, RelaxingResidual
from sainet.scenes.state import pack_motion


class LossWeights(eqx.Module):
    """Weights of the terms: the settings over the variance in the training data."""

    position: Float[Array, ""]  # 1/m^2
    rotation: Float[Array, ""]
    velocity: Float[Array, ""]  # s^2/m^2
    spin: Float[Array, ""]  # s^2/rad^2
    linear_from: float = eqx.field(static=True, default=0.0)  # 0: nowhere


# Of each body: predicted against true.
Error = Callable[[Array, Array, LossWeights], Array]


class Target(eqx.Module):
    """What was observed, in the push frame, time first."""

    pose: Float[Array, "time push body 3"]
    rate: Float[Array, "time push body 3"]
    pose_observed: Bool[Array, "time push"]
    rate_observed: Bool[Array, "time push"]


def push_losses(
    predicted: Float[Array, "time push body 6"], target: Target, weights: LossWeights
) -> Float[Array, " push"]:
    """Return the paper's loss of each push: summed over bodies, mean over time.

    Rotations are compared by sine and cosine. What was not observed counts for
    nothing: the mean is over the observed steps. A push that is wrong by more than
    `weights.linear_from` counts by its error, not by the square of it.
    """
    pose = _masked_error(
        predicted[..., 0:3], target.pose, target.pose_observed, _pose_error, weights
    )
    rate = _masked_error(
        predicted[..., 3:6], target.rate, target.rate_observed, _rate_error, weights
    )
    return _linear_beyond(weights.linear_from, pose + rate)


def _linear_beyond(error: float, loss: Array) -> Array:
    """Return the pseudo-Huber loss: squares up to about this error, then linear."""
    if not error:
        return loss
    return 2 * error**2 * (jnp.sqrt(1 + loss / error**2) - 1)


def _pose_error(predicted: Array, true: Array, weights: LossWeights) -> Array:
    place = jnp.sum((predicted[..., 0:2] - true[..., 0:2]) ** 2, axis=-1)
    sine = (jnp.sin(predicted[..., 2]) - jnp.sin(true[..., 2])) ** 2
    cosine = (jnp.cos(predicted[..., 2]) - jnp.cos(true[..., 2])) ** 2
    return weights.position * place + weights.rotation * (sine + cosine)


def _rate_error(predicted: Array, true: Array, weights: LossWeights) -> Array:
    velocity = jnp.sum((predicted[..., 0:2] - true[..., 0:2]) ** 2, axis=-1)
    spin = (predicted[..., 2] - true[..., 2]) ** 2
    return weights.velocity * velocity + weights.spin * spin


def _masked_error(
    predicted: Array, true: Array, observed: Array, error: Error, weights: LossWeights
) -> Array:
    # The true value may be NaN where nothing was observed; replace it before it is
    # used, for zero times NaN is NaN in the gradient.
    known = jnp.broadcast_to(observed[..., None, None], true.shape)
    true = jnp.where(known, true, predicted)
    errors = jnp.sum(error(predicted, true, weights), axis=-1)
    count = jnp.maximum(jnp.sum(observed, axis=0), 1)
    return jnp.sum(jnp.where(observed, errors, 0.0), axis=0) / count


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


Columns = Callable[[Moment], Array]
Weights = Callable[[Moment], Array | None]

# A deviation below this, or this share of the mean, is rounding: nothing varies.
_CONSTANT, _CONSTANT_SHARE = 1e-9, 1e-4
CONSTANT = 1.0  # stands for the deviation of a feature that never varies
_STILL = 1e-14  # a mean square (m^2) or acceleration (m/s^2) below this is rounding


@eqx.filter_jit
def feature_scales(
    batch: PushBatch,
    features: AbstractFeatures,
    integrator: Integrator = Acceleration(),  # noqa: B008
) -> Scales:
    """Return means and deviations of a network's inputs along the true paths.

    The scale of its output is the acceleration of the bodies or, for an additive
    network, the acceleration that corrects the engine.
    """
    frame = push_frame(batch.scene, batch.initial)
    motion = path_to_frame(_known_motion(batch), frame)
    start = motion_to_frame(pack_motion(batch.initial), frame)
    before = jnp.concatenate([start[None], motion[:-1]])
    simulated = None
    if features.has_simulator and batch.simulated is not None:
        simulated = jnp.moveaxis(path_to_frame(batch.simulated, frame), 0, 1)
    drive = drives(batch.controls.in_frame(frame.origin, frame.angle), start, simulated)
    drive = jax.tree.map(lambda x: jnp.moveaxis(x, 1, 0), drive)
    still = in_columns(features.still(batch.scene, frame))
    columns = jax.vmap(in_columns)((before, drive))

    def spread(inputs: Columns, weights: Weights, signs: Signs) -> tuple[Array, Array]:
        def at(now: tuple[Array, Drive]) -> tuple[Array, Array | None]:
            moment = Moment(now[0], still, now[1])
            return inputs(moment), weights(moment)

        return _spread(*jax.vmap(at, out_axes=(1, 0))(columns), signs)

    body_mean, body_deviation = spread(
        features.of_bodies, features.body_weights, features.body_signs
    )
    if batch.scene.body_count > 1 and features.pair_size:
        pair_mean, pair_deviation = spread(
            features.of_pairs, features.pair_weights, features.pair_signs
        )
    else:
        pair_mean = jnp.zeros(features.pair_size)
        pair_deviation = jnp.ones_like(pair_mean)
    change = (motion[..., 3:6] - before[..., 3:6]) / batch.scene.time_step
    size = _output_size(batch, integrator, change)
    return Scales(
        pair_mean=pair_mean,
        pair_deviation=pair_deviation,
        body_mean=body_mean,
        body_deviation=body_deviation,
        # x and y share a scale: no direction of the frame counts more.
        acceleration=jnp.array([size[:2].mean(), size[:2].mean(), size[2]]),
    )


def _spread(
    features: Array, weights: Array | None, signs: Signs
) -> tuple[Array, Array]:
    """Return means and deviations, over mirrored pushes too where there are signs."""
    rows = features.reshape(features.shape[0], -1)
    if weights is None:
        mean, deviation = jnp.mean(rows, axis=1), jnp.std(rows, axis=1)
    else:
        shares = weights.reshape(-1) / jnp.maximum(jnp.sum(weights), _CONSTANT)
        mean = jnp.sum(rows * shares[None], axis=1)
        if signs:
            mean = jnp.where(jnp.array(signs) < 0, 0.0, mean)
        spread = (rows - mean[:, None]) ** 2
        deviation = jnp.sqrt(jnp.sum(spread * shares[None], axis=1))
    return mean, known_deviation(mean, deviation)


def known_deviation(mean: Array, deviation: Array) -> Array:
    """Return deviations, `CONSTANT` where they are rounding errors of the mean."""
    varies = deviation > jnp.maximum(_CONSTANT, _CONSTANT_SHARE * jnp.abs(mean))
    return jnp.where(varies, deviation, CONSTANT)


@eqx.filter_jit
def loss_weights(batch: PushBatch, objective: Objective) -> LossWeights:
    """Return the weights of the objective over mean squares in the data.

    The mean squares are those of the motion, or of the errors of s-bar where the truth
    was observed: training is to reduce errors, and where only the end of a push is
    known, position and rotation would otherwise have very unequal weights.
    """
    if objective.terms == "metres":
        return _in_metres(objective)
    by_motion = objective.terms == "motion"
    pose, rate = _motion(batch) if by_motion else _errors(batch)
    place = jnp.nanmean(jnp.sum(pose[..., 0:2] ** 2, axis=-1))
    velocity = jnp.nanmean(jnp.sum(rate[..., 0:2] ** 2, axis=-1))
    turn = jnp.nanmean(pose[..., 2] ** 2)
    return LossWeights(
        position=objective.weight_position / _nonzero(place),
        rotation=objective.weight_rotation / _nonzero(turn),
        velocity=objective.weight_velocity / _nonzero(velocity),
        spin=objective.weight_spin / _nonzero(jnp.nanmean(rate[..., 2] ** 2)),
        linear_from=objective.linear_from,
    )


def _in_metres(objective: Objective) -> LossWeights:
    """Return the weights of the paper's loss: of squared m, m/s and rad/s as they are.

    The paper writes the velocity of a pose, with its spin.
    """
    return LossWeights(
        position=jnp.float32(objective.weight_position),
        rotation=jnp.float32(objective.weight_rotation),
        velocity=jnp.float32(objective.weight_velocity),
        spin=jnp.float32(objective.weight_spin),
        linear_from=objective.linear_from,
    )


def _motion(batch: PushBatch) -> tuple[Array, Array]:
    """Return how far bodies have moved, and their velocities."""
    motion = _known_motion(batch)
    start = pack_motion(batch.initial)[:, None]
    return motion[..., 0:3] - start[..., 0:3], motion[..., 3:6]


def _errors(batch: PushBatch) -> tuple[Array, Array]:
    """Return the errors of s-bar, NaN where the truth was not observed."""
    assert batch.simulated is not None
    error = batch.truth - batch.simulated

    def where(observed: Array, part: Array) -> Array:
        return jnp.where(observed[:, :, None, None], part, jnp.nan)

    return (
        where(batch.pose_observed, error[..., 0:3]),
        where(batch.rate_observed, error[..., 3:6]),
    )


def _output_size(batch: PushBatch, integrator: Integrator, change: Array) -> Array:
    """Return the size of the true accelerations, or of those that correct s-bar."""
    if isinstance(integrator, RelaxingResidual):
        return _correction(batch, integrator)
    return jnp.sqrt(jnp.mean(change**2, axis=(0, 1, 2)))


def _correction(batch: PushBatch, integrator: RelaxingResidual) -> Array:
    """Return the constant acceleration that deviates as far as s-bar errs.

    By mean absolute errors, which failed recordings do not dominate: of x and y (m/s^2)
    and of the angle (rad/s^2).
    """
    pose, _ = _errors(batch)
    gains = integrator.gains(batch.scene.time_step, pose.shape[1])
    gain = jnp.asarray(gains.pose_of_change)
    reached = jnp.where(jnp.isnan(pose), jnp.nan, gain[:, None, None])
    size = jnp.nanmean(jnp.abs(pose), axis=(0, 1, 2))
    return _nonzero(size / jnp.nanmean(reached, axis=(0, 1, 2)))


def _nonzero(size: Array) -> Array:
    """Return a size, or 1 where it is zero, for example of a disk that never turns."""
    return jnp.where(size > _STILL, size, CONSTANT)


def _known_motion(batch: PushBatch) -> Array:
    """Return the true motion, or the simulated motion where the truth is unknown."""
    if batch.simulated is None:
        return jnp.nan_to_num(batch.truth)
    return jnp.where(jnp.isnan(batch.truth), batch.simulated, batch.truth)
