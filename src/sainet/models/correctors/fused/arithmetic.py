"""What both kernels compute with: small products, rows, bounds."""

import jax.numpy as jnp
from jax import lax
from jaxtyping import Array

from sainet.models.correctors.fused.layout import COLUMNS, PUSHES, ROWS, Ref, Settings
from sainet.models.correctors.network import FEATURE_BOUND
from sainet.models.integrators import GRADIENT_BOUND

_OVERFLOW = 1e37  # what is larger counts as infinite: sixteen of these still add up


def exact(a: Array, b: Array) -> Array:
    """Return a product in single precision, not in TF32."""
    return jnp.dot(a, b, precision=lax.Precision.HIGHEST)


def swapped(x: Array) -> Array:
    """Return columns with both disks of each push exchanged.

    What overflowed is replaced: the product would spread it to the other pushes.
    """
    row = lax.broadcasted_iota(jnp.int32, (COLUMNS, COLUMNS), 0)
    column = lax.broadcasted_iota(jnp.int32, (COLUMNS, COLUMNS), 1)
    other = jnp.where(column < PUSHES, column + PUSHES, column - PUSHES)
    finite = jnp.where(jnp.abs(x) < _OVERFLOW, x, _OVERFLOW)
    return exact(finite, jnp.where(row == other, 1.0, 0.0))


def row(x: Array, index: int) -> Array:
    """Return a row of a matrix."""
    rows = lax.broadcasted_iota(jnp.int32, x.shape, 0)
    return jnp.sum(jnp.where(rows == index, x, 0.0), axis=0)


def as_place(x: Array, y: Array, shape: tuple[int, ...]) -> Array:
    """Return a matrix with the first two rows given, zero elsewhere."""
    rows = lax.broadcasted_iota(jnp.int32, shape, 0)
    return jnp.where(rows == 0, x[None], jnp.where(rows == 1, y[None], 0.0))


def to_pusher(times: Ref, t: Array, motion: Array) -> tuple[Array, Array, Array]:
    """Return the offset of the pusher from each disk and its length (m)."""
    east, north = (times.pusher[t, i] - row(motion, i) for i in range(2))
    return east, north, jnp.sqrt(east**2 + north**2 + 1e-12)


def bound(settings: Settings, x: Array) -> Array:
    """Bound inputs as `network.standardise` does."""
    return FEATURE_BOUND * jnp.tanh(x / FEATURE_BOUND) if settings.is_bounded else x


def bound_slope(settings: Settings, bounded: Array) -> Array | float:
    """Return the derivative of `bound`, by its result."""
    return 1.0 - (bounded / FEATURE_BOUND) ** 2 if settings.is_bounded else 1.0


def bound_gradient(slope: Array, sizes: Array) -> Array:
    """Bound the gradient of each push as `integrators.bound_gradient` does."""
    squared = (slope * sizes) ** 2
    squared = jnp.where(squared < _OVERFLOW, squared, _OVERFLOW)
    each = exact(jnp.ones((ROWS, ROWS), jnp.float32), squared)
    whole = each + swapped(each)
    share = jnp.minimum(1.0, GRADIENT_BOUND * lax.rsqrt(jnp.maximum(whole, 1e-30)))
    usable = (whole < _OVERFLOW) & (jnp.abs(slope) < _OVERFLOW)
    return jnp.where(usable, slope * share, 0.0)
