"""Settings of simulated scenes and pushes, free of JAX."""

from dataclasses import dataclass, field
from numbers import Real
from typing import Literal, get_args

import numpy as np

from sainet.runs.errors import require, require_one_of
from sainet.scenes import quantities
from sainet.worlds.noise import NoiseConfig, NoiseLevel

SetupName = Literal["robot", "direct-force"]
# cluster: disks 2 and 3 touch disk 1, further ones any other (the paper). row: each
# touches the one before. triangle: each further one touches two others.
Arrangement = Literal["cluster", "row", "triangle"]
Range = tuple[float] | tuple[float, float]
OfDisks = tuple[tuple[float, ...]]  # one constant for each disk
_RIGHT_ANGLE = 90  # degrees

_COUNTS = {
    "disks": (1, quantities.MOST_DISKS),
    "force_steps": (1, quantities.MOST_STEPS),
    "hold_steps": (0, quantities.MOST_STEPS),
}
_RANGES = {
    "mass_kg": quantities.MASS,
    "radius_mm": quantities.RADIUS.times(1000, "mm"),
    "stroke_mm": quantities.STROKE.times(1000, "mm"),
    "speed_mm_s": quantities.SPEED.times(1000, "mm/s"),
    "table_friction": quantities.FRICTION,
    "contact_friction": quantities.FRICTION,
}
_QUANTITIES = {
    "pusher_radius_mm": quantities.PUSHER_RADIUS.times(1000, "mm"),
    "force_n": quantities.PUSHING_FORCE,
    "damping_n_s_m": quantities.STABLE_DAMPING,
    "gap_mm": quantities.START_GAP.times(1000, "mm"),
}


@dataclass(frozen=True, kw_only=True)
class WorldConfig:
    """Distributions of random scenes and pushes (the paper's, section IV-B).

    A range is a uniform distribution between two numbers, or one constant.
    """

    disks: int = 2
    """Number of disks."""
    mass_kg: Range = (0.85, 1.15)
    """Mass of a disk (kg, range)."""
    radius_mm: Range = (50.0, 60.0)
    """Radius of a disk (mm, range)."""
    table_friction: Range = (0.05, 0.25)
    """Friction coefficient between disks and table (range, one value per push)."""
    contact_friction: Range = (0.25,)
    """Friction coefficient between disks, and between disk and pusher (range)."""
    pusher_radius_mm: float = 4.8
    """Radius of the pusher (mm)."""
    contact_angle_deg: float = 60.0
    """Largest contact angle, from the back of disk 1 to either side (degrees)."""
    direction_deg: float = 30.0
    """Largest push direction, relative to the contact normal (degrees)."""
    placement_deg: float = 60.0
    """Largest angle between the line of two neighbouring disks and the push frame's x
    axis (degrees)."""
    arrangement: Arrangement = "cluster"
    """Arrangement of the disks: cluster (disks 2 and 3 touch disk 1, further ones any
    other), row (each touches the one before) or triangle (disk 2 touches disk 1,
    further ones two others)."""
    gap_mm: float = 0.0
    """Initial gap between neighbouring disks, and between disk 1 and pusher (mm);
    negative: they overlap."""
    stroke_mm: Range = (10.0,)
    """Stroke of a push (mm, range; robot)."""
    speed_mm_s: Range = (50.0,)
    """Speed of a push (mm/s, range; robot)."""
    hold_steps: int = 152
    """Number of steps after the stroke (robot). The total, 48 + 152 = 200 with the
    defaults, is rounded up to a multiple of 40."""
    force_n: float = 8.0
    """Force on the pusher (N; direct force)."""
    damping_n_s_m: float = 1000.0
    """Viscous damping of the pusher (N s/m; direct force)."""
    force_steps: int = 480
    """Number of steps with force (direct force), 1/240 s each."""
    noise_level: NoiseLevel = "default"
    """Scale of all noise; paper-like is three times the default."""
    noise: NoiseConfig = field(default_factory=NoiseConfig)
    """The sources of noise."""

    def __post_init__(self) -> None:
        """Check every setting.

        Raises:
            BadSetting: a value is out of its range.
        """
        is_noise = isinstance(self.noise, NoiseConfig)  # pyright: ignore
        require(is_noise, "noise", "a NoiseConfig", self.noise)
        require_one_of("noise_level", self.noise_level, get_args(NoiseLevel))
        require_one_of("arrangement", self.arrangement, get_args(Arrangement))
        for name, (low, high) in _COUNTS.items():
            quantities.require_count(name, getattr(self, name), low=low, high=high)
        for name, quantity in _RANGES.items():
            _check_range(name, getattr(self, name), quantity)
        for name, quantity in _QUANTITIES.items():
            quantity.require(name, getattr(self, name))
        for name in ("contact_angle_deg", "direction_deg", "placement_deg"):
            value = getattr(self, name)
            is_acute = isinstance(value, Real) and 0 <= float(value) < _RIGHT_ANGLE
            require(is_acute, name, "a number from 0 to below 90", value)

    @property
    def masses(self) -> Range | OfDisks:
        """The distribution of the masses of the disks (kg)."""
        return self.mass_kg

    @property
    def radii(self) -> Range | OfDisks:
        """The distribution of the radii of the disks (mm)."""
        return self.radius_mm


def bounds(values: Range) -> tuple[float, float]:
    """Return the low and the high end of a range of one or two numbers."""
    return values[0], values[-1]


def _check_range(name: str, values: Range, quantity: quantities.Quantity) -> None:
    quantity.require(name, values)
    is_range = np.ndim(values) == 1 and len(values) in (1, 2)
    require(is_range, name, "a tuple of one number or two", values)
    require(values[0] <= values[-1], name, "a range, low before high", values)
