"""Noise of the simulated world, which acts on ground truth, never on predictions.

Drawn with NumPy from explicit generators, one batch of pushes at a time. Free of JAX.
"""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from jaxtyping import Bool, Float

from sainet.scenes import quantities

FRICTION_FEATURES = 32
NoiseLevel = Literal["none", "default", "paper-like"]
# Scaled by a level.
_SIZES = (
    *("tracking_mm", "force_fraction", "friction_fraction"),
    *("capture_mm", "capture_deg"),
)
_FACTOR = {"none": 0.0, "default": 1.0, "paper-like": 3.0}
_QUANTITIES = {
    "tracking_mm": quantities.LENGTH_DEVIATION.times(1000, "mm"),
    "correlation_time": quantities.CORRELATION_TIME,
    "force_fraction": quantities.FRACTION,
    "friction_fraction": quantities.FRACTION,
    "friction_length_mm": quantities.CORRELATION_LENGTH.times(1000, "mm"),
    "capture_mm": quantities.LENGTH_DEVIATION.times(1000, "mm"),
    "capture_deg": quantities.ANGLE_DEVIATION,
}


@dataclass(frozen=True, kw_only=True)
class NoiseConfig:
    """Noise that separates ground truth from any engine; 0 turns a source off."""

    tracking_mm: float = 0.2
    """Pusher tracking error (standard deviation, mm)."""
    correlation_time: float = 0.1
    """Correlation time of tracking and force errors (Ornstein-Uhlenbeck, s)."""
    force_fraction: float = 0.1
    """Force error on the pusher (fraction of the force)."""
    friction_fraction: float = 0.15
    """Variation of the table friction over the table (fraction of the friction)."""
    friction_length_mm: float = 30.0
    """Correlation length of the table-friction variation (mm)."""
    capture_mm: float = 0.15
    """White noise of measured positions (standard deviation, mm)."""
    capture_deg: float = 0.1
    """White noise of measured angles (standard deviation, degrees)."""

    def __post_init__(self) -> None:
        """Check the range of every setting."""
        for name, quantity in _QUANTITIES.items():
            quantity.require(name, getattr(self, name))


def at_level(noise: NoiseConfig, level: NoiseLevel) -> NoiseConfig:
    """Return the noise with its sizes at a named level: 0, 1 or 3 times."""
    factor = _FACTOR[level]
    return replace(noise, **{name: factor * getattr(noise, name) for name in _SIZES})


def ornstein_uhlenbeck(
    rng: np.random.Generator,
    shape: tuple[int, int, int],
    deviation: float,
    noise: NoiseConfig,
    time_step: float,
) -> Float[np.ndarray, "push time axis"]:
    """Return an Ornstein-Uhlenbeck process that starts at zero.

    Args:
        rng: random generator.
        shape: pushes, steps and axes; axes are independent.
        deviation: stationary standard deviation, in the unit of the result.
        noise: has the correlation time.
        time_step: s.
    """
    # Imported here: the import takes half a second, which other commands can skip.
    from scipy.signal import lfilter

    keep = np.exp(-time_step / noise.correlation_time)
    kick = deviation * np.sqrt(1 - keep**2) * rng.standard_normal(shape)
    return np.asarray(lfilter([1.0], [1.0, -keep], kick, axis=1))


def tracking_error(
    rng: np.random.Generator,
    moving: Bool[np.ndarray, "push time"],
    noise: NoiseConfig,
    time_step: float,
) -> Float[np.ndarray, "push time 2"]:
    """Return tracking errors of the pusher (m), constant while the pusher holds."""
    shape, deviation = (*moving.shape, 2), noise.tracking_mm / 1000
    error = ornstein_uhlenbeck(rng, shape, deviation, noise, time_step)
    last_moving = np.maximum.accumulate(
        np.where(moving, np.arange(moving.shape[1]), 0), axis=1
    )
    return np.take_along_axis(error, last_moving[..., None], axis=1)


def force_error(
    rng: np.random.Generator,
    force: Float[np.ndarray, "push time 2"],
    noise: NoiseConfig,
    time_step: float,
) -> Float[np.ndarray, "push time 2"]:
    """Return errors of the force on the pusher (N)."""
    deviation = noise.force_fraction
    error = ornstein_uhlenbeck(rng, force.shape, deviation, noise, time_step)
    return error * np.linalg.norm(force, axis=-1, keepdims=True)


def friction_features(
    rng: np.random.Generator, pushes: int, noise: NoiseConfig
) -> dict[str, np.ndarray]:
    """Return random fields of `scenes.scene.FrictionField` for a batch of tables."""
    length = noise.friction_length_mm / 1000
    shape = (pushes, FRICTION_FEATURES)
    amplitude = noise.friction_fraction * np.sqrt(2 / FRICTION_FEATURES)
    return {
        "wave": rng.standard_normal((*shape, 2)) / length,
        "phase": rng.uniform(0, 2 * np.pi, shape),
        "amplitude": np.full(pushes, amplitude),
    }


def capture_error(
    rng: np.random.Generator, shape: tuple[int, int, int], noise: NoiseConfig
) -> Float[np.ndarray, "push time body 3"]:
    """Return motion-capture errors of x and y (m) and of the angle (rad)."""
    size = [noise.capture_mm / 1000] * 2 + [np.deg2rad(noise.capture_deg)]
    return rng.standard_normal((*shape, 3)) * np.array(size)
