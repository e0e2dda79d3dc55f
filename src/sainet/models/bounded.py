"""Bounds on gradients through time: over 200 steps of contact they would explode."""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

# Typical sizes of x, y (m), angle (rad) and their rates, which make a gradient with
# respect to packed motion dimensionless.
GRADIENT_SIZES = (0.01, 0.01, 0.05, 0.03, 0.03, 0.2)
GRADIENT_BOUND = 5.0  # norm of a push's gradient in these sizes; typically about 1


@jax.custom_vjp
def bound_gradient(motion: Float[Array, "6 body push"]) -> Float[Array, "6 body push"]:
    """Return the motion, and bound the gradient of each push in the backward pass.

    The gradient of a diverging prediction grows with every step and would dominate its
    batch (Graves 2013 bounds recurrent gradients in the same way).
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
