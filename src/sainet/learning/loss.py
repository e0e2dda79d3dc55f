"""How far predicted pushes are from what was observed of them."""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float


class LossWeights(eqx.Module):
    """Weights of the terms: the settings over the variance in the training data."""

    position: Float[Array, ""]  # 1/m^2
    rotation: Float[Array, ""]
    velocity: Float[Array, ""]  # s^2/m^2
    spin: Float[Array, ""]  # s^2/rad^2
    linear_from: float = eqx.field(static=True, default=0.0)  # 0: nowhere


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
        predicted[..., 0:3], target.pose, target.pose_observed, _pose_error(weights)
    )
    rate = _masked_error(
        predicted[..., 3:6], target.rate, target.rate_observed, _rate_error(weights)
    )
    return _linear_beyond(weights.linear_from, pose + rate)


def _linear_beyond(error: float, loss: Array) -> Array:
    """Return the pseudo-Huber loss: squares up to about this error, then linear."""
    if not error:
        return loss
    return 2 * error**2 * (jnp.sqrt(1 + loss / error**2) - 1)


def _pose_error(weights: LossWeights):  # noqa: ANN202
    def error(predicted: Array, true: Array) -> Array:
        place = jnp.sum((predicted[..., 0:2] - true[..., 0:2]) ** 2, axis=-1)
        sine = (jnp.sin(predicted[..., 2]) - jnp.sin(true[..., 2])) ** 2
        cosine = (jnp.cos(predicted[..., 2]) - jnp.cos(true[..., 2])) ** 2
        return weights.position * place + weights.rotation * (sine + cosine)

    return error


def _rate_error(weights: LossWeights):  # noqa: ANN202
    def error(predicted: Array, true: Array) -> Array:
        velocity = jnp.sum((predicted[..., 0:2] - true[..., 0:2]) ** 2, axis=-1)
        spin = (predicted[..., 2] - true[..., 2]) ** 2
        return weights.velocity * velocity + weights.spin * spin

    return error


def _masked_error(predicted: Array, true: Array, observed: Array, error) -> Array:  # noqa: ANN001
    # The true value may be NaN where nothing was observed; replace it before it is
    # used, for zero times NaN is NaN in the gradient.
    known = jnp.broadcast_to(observed[..., None, None], true.shape)
    errors = jnp.sum(error(predicted, jnp.where(known, true, predicted)), axis=-1)
    count = jnp.maximum(jnp.sum(observed, axis=0), 1)
    return jnp.sum(jnp.where(observed, errors, 0.0), axis=0) / count
