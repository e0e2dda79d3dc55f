"""Angles and frames in the plane of the table."""

from typing import TypeVar

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

A = TypeVar("A", Array, np.ndarray)


def unit(angle: Float[Array, "*batch"]) -> Float[Array, "*batch 2"]:
    """Return the unit vector at an angle (rad, counter-clockwise from x)."""
    return jnp.stack([jnp.cos(angle), jnp.sin(angle)], axis=-1)


def rotate(
    vector: Float[Array, "*batch 2"], angle: Float[Array, "*#batch"]
) -> Float[Array, "*batch 2"]:
    """Return vectors rotated counter-clockwise by an angle (rad)."""
    cosine, sine = jnp.cos(angle), jnp.sin(angle)
    x, y = vector[..., 0], vector[..., 1]
    return jnp.stack([cosine * x - sine * y, sine * x + cosine * y], axis=-1)


def direction(vector: Float[Array, "*batch 2"]) -> Float[Array, "*batch"]:
    """Return the angle (rad) of a vector, counter-clockwise from x."""
    return jnp.arctan2(vector[..., 1], vector[..., 0])


def norm(vector: Float[Array, "*batch 2"]) -> Float[Array, "*batch"]:
    """Return the length of vectors; its gradient at zero is zero, never NaN."""
    squared = jnp.sum(vector * vector, axis=-1)
    nonzero = squared != 0  # also NaN, whose length is NaN
    return jnp.where(nonzero, jnp.sqrt(jnp.where(nonzero, squared, 1.0)), 0.0)


def wrap_angle(angle: A) -> A:
    """Return angles wrapped into [-pi, pi) (rad)."""
    return (angle + np.pi) % (2 * np.pi) - np.pi
