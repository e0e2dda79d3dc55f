"""Noise of the simulated world, which acts on ground truth, never on predictions.

Drawn with NumPy from explicit generators, one batch of pushes at a time.
"""

import numpy as np
from jaxtyping import Bool, Float

from sainet.worlds.noise_config import NoiseConfig

FRICTION_FEATURES = 32


def ornstein_uhlenbeck(
    rng: np.random.Generator,
    shape: tuple[int, int, int],
    *,
    deviation: float,
    correlation_time: float,
    time_step: float,
) -> Float[np.ndarray, "push time axis"]:
    """Return an Ornstein-Uhlenbeck process that starts at zero.

    Args:
        rng: random generator.
        shape: pushes, steps and axes; axes are independent.
        deviation: stationary standard deviation, in the unit of the result.
        correlation_time: s.
        time_step: s.
    """
    # Imported here: the import takes half a second, which other commands can skip.
    from scipy.signal import lfilter

    keep = np.exp(-time_step / correlation_time)
    kick = deviation * np.sqrt(1 - keep**2) * rng.standard_normal(shape)
    return np.asarray(lfilter([1.0], [1.0, -keep], kick, axis=1))


def tracking_error(
    rng: np.random.Generator,
    moving: Bool[np.ndarray, "push time"],
    noise: NoiseConfig,
    time_step: float,
) -> Float[np.ndarray, "push time 2"]:
    """Return tracking errors of the pusher (m), constant while the pusher holds."""
    error = ornstein_uhlenbeck(
        rng,
        (*moving.shape, 2),
        deviation=noise.tracking_mm / 1000,
        correlation_time=noise.correlation_time,
        time_step=time_step,
    )
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
    error = ornstein_uhlenbeck(
        rng,
        force.shape,
        deviation=noise.force_fraction,
        correlation_time=noise.correlation_time,
        time_step=time_step,
    )
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
