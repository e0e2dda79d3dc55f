"""Settings of the simulated world, free of JAX."""

from dataclasses import dataclass, replace
from typing import Literal

from sainet.scenes.quantities import (
    ANGLE_DEVIATION,
    CORRELATION_LENGTH,
    CORRELATION_TIME,
    FRACTION,
    LENGTH_DEVIATION,
)

NoiseLevel = Literal["none", "default", "paper-like"]
_FACTOR = {"none": 0.0, "default": 1.0, "paper-like": 3.0}
_QUANTITIES = {
    "tracking_mm": LENGTH_DEVIATION.times(1000, "mm"),
    "correlation_time": CORRELATION_TIME,
    "force_fraction": FRACTION,
    "friction_fraction": FRACTION,
    "friction_length_mm": CORRELATION_LENGTH.times(1000, "mm"),
    "capture_mm": LENGTH_DEVIATION.times(1000, "mm"),
    "capture_deg": ANGLE_DEVIATION,
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
    return replace(
        noise,
        tracking_mm=factor * noise.tracking_mm,
        force_fraction=factor * noise.force_fraction,
        friction_fraction=factor * noise.friction_fraction,
        capture_mm=factor * noise.capture_mm,
        capture_deg=factor * noise.capture_deg,
    )
