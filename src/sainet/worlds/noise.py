"""Noise of the simulated world: of the truth alone, never of a prediction.

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
    """Draw a mean-reverting random walk that starts at zero.

    Args:
        rng: where the randomness comes from.
        shape: pushes, steps and axes; axes are independent.
        deviation: stationary standard deviation, in the unit of the result.
        correlation_time: s.
        time_step: s.
    """
    # Here: it takes half a second, which planning and --help need not wait for.
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
    """Draw the pusher's error about its path (m); while it holds, it stays put."""
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
    """Draw the error of the force on the pusher (N)."""
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
    """Draw the fields of `sainet.scenes.scene.FrictionField` for a batch of tables."""
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
    """Draw the error of motion capture: of x and y (m) and of the angle (rad)."""
    size = [noise.capture_mm / 1000] * 2 + [np.deg2rad(noise.capture_deg)]
    return rng.standard_normal((*shape, 3)) * np.array(size)
