"""Bounds on gradients through time: over 200 steps of contact they would explode."""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

# Typical sizes of x, y (m), angle (rad) and their rates: they make a gradient with
# respect to packed motion one without units.
GRADIENT_SIZES = (0.01, 0.01, 0.05, 0.03, 0.03, 0.2)
GRADIENT_BOUND = 5.0  # of a push's loss to its motion in these sizes; about 1 is usual


@jax.custom_vjp
def bound_gradient(motion: Float[Array, "6 body push"]) -> Float[Array, "6 body push"]:
    """Return the motion; on the way back, shorten each push's gradient to the bound.

    A push whose prediction runs away has a gradient that grows with every step, and
    would outweigh all others of its batch (Graves 2013 bounds recurrent gradients so).
    """
    return motion


def _forward(motion: Array) -> tuple[Array, None]:
    return motion, None


def _backward(_: None, gradient: Array) -> tuple[Array]:
    sizes = jnp.array(GRADIENT_SIZES, gradient.dtype)[:, None, None]
    squared = jnp.sum((gradient * sizes) ** 2, axis=(0, 1), keepdims=True)
    # An overflow counts as zero: its direction is lost as well.
    share = jnp.minimum(
        1.0, GRADIENT_BOUND * jax.lax.rsqrt(jnp.maximum(squared, 1e-30))
    )
    usable = jnp.isfinite(squared) & jnp.isfinite(gradient)
    return (jnp.where(usable, gradient * share, 0.0),)


bound_gradient.defvjp(_forward, _backward)
