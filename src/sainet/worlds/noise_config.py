"""Settings of the simulated world, free of JAX."""

from dataclasses import dataclass, replace
from typing import Literal

NoiseLevel = Literal["none", "default", "paper-like"]
_FACTOR = {"none": 0.0, "default": 1.0, "paper-like": 3.0}


@dataclass(frozen=True, kw_only=True)
class NoiseConfig:
    """What makes the simulated truth differ from any engine; 0 turns a source off."""

    tracking_mm: float = 0.2
    """Error of the pusher about its commanded path, standard deviation in mm."""
    correlation_time: float = 0.1
    """Of the tracking and force errors (Ornstein-Uhlenbeck), in seconds."""
    force_fraction: float = 0.1
    """Error of the force on the pusher, as a fraction of it."""
    friction_fraction: float = 0.15
    """Variation of the table's friction over the table, as a fraction of it."""
    friction_length_mm: float = 30.0
    """Correlation length of that variation, in mm."""
    capture_mm: float = 0.15
    """Error of the motion capture's positions, white, in mm."""
    capture_deg: float = 0.1
    """Error of the motion capture's angles, white, in degrees."""


def at_level(noise: NoiseConfig, level: NoiseLevel) -> NoiseConfig:
    """Return the noise with its sizes at a named level: 0, 1 or 3 times."""
    factor = _FACTOR[level]
    return replace(
        noise,
        tracking_mm=factor * noise.tracking_mm,
        force_fraction=factor * noise.force_fraction,
        friction_fraction=factor * noise.friction_fraction,
        capture_mm=factor * noise.capture_mm,
        capture_deg=factor * noise.capture_deg,
    )
