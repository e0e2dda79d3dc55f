"""Static properties of disks on a table and of the pusher.

Units are metres, radians, kilograms and seconds, in the table frame. Leading batch axes
are optional; there is at least one disk.
"""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from sainet.runs.errors import BadScene

GRAVITY = 9.81  # m/s^2


TIME_STEP = 1 / 240  # s, the paper's


class FrictionField(eqx.Module):
    """A Gaussian random field that multiplies table friction.

    Its value is ``1 + amplitude * sum(cos(wave . p + phase))``, a sum of random
    Fourier features. With waves from a normal distribution of standard deviation
    1 / length, its correlation is a Gaussian of that length.
    """

    wave: Float[Array, "*batch feature 2"]  # rad/m
    phase: Float[Array, "*batch feature"]  # rad
    amplitude: Float[Array, "*batch"]

    def at(
        self, x: Float[Array, "*batch"], y: Float[Array, "*batch"]
    ) -> Float[Array, "*batch"]:
        """Return the multiplier at a position (m), at least 0.1."""
        phase = (
            self.wave[..., 0] * x[..., None]
            + self.wave[..., 1] * y[..., None]
            + self.phase
        )
        value = 1 + self.amplitude * jnp.sum(jnp.cos(phase), axis=-1)
        return jnp.maximum(value, 0.1)


class Scene(eqx.Module):
    """Static properties of disks on a table and of the pusher."""

    mass: Float[Array, "*batch body"]  # kg
    radius: Float[Array, "*batch body"]  # m
    table_friction: Float[Array, "*batch"]  # between a disk and the table
    disk_friction: Float[Array, "*batch"]  # between two disks
    pusher_friction: Float[Array, "*batch"]  # between the pusher and a disk
    pusher_radius: Float[Array, "*batch"]  # m
    friction_field: FrictionField | None = None
    time_step: float = eqx.field(static=True, default=TIME_STEP)  # s

    @property
    def body_count(self) -> int:
        """The number of disks."""
        return self.mass.shape[-1]

    @property
    def batch_shape(self) -> tuple[int, ...]:
        """The leading axes that all fields share."""
        return self.mass.shape[:-1]


_POSITIVE = ("mass", "radius", "pusher_radius")


_NOT_NEGATIVE = ("table_friction", "disk_friction", "pusher_friction")


def check_scene(scene: Scene, source: str = "scene") -> None:
    """Raise `BadScene` unless every property is finite and of the right sign.

    Args:
        scene: any batch shape, not traced.
        source: name for the message, for example a file.

    Raises:
        BadScene: with the source, the field, the value and what it must be.
    """
    for name in _POSITIVE + _NOT_NEGATIVE:
        values = np.asarray(getattr(scene, name))
        low = values > 0 if name in _POSITIVE else values >= 0
        good = np.isfinite(values) & low
        if not good.all():
            wanted = "positive" if name in _POSITIVE else "zero or positive"
            value = values[~good].flat[0]
            raise BadScene(f"{source}: {name} is {value}; it must be {wanted}.")
