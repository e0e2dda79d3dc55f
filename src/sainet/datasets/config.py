"""Settings of simulated datasets, free of JAX."""

from dataclasses import dataclass, field
from typing import Literal, get_args

from tyro.conf import Positional

from sainet.engines import ENGINES
from sainet.engines.simulator import SIMULATORS
from sainet.runs.errors import require, require_one_of
from sainet.scenes.quantities import (
    FRICTION,
    GAP,
    LARGEST_COUNT,
    MASS,
    MOST_DISKS,
    MOST_PUSHES,
    MOST_STEPS,
    PUSHER_RADIUS,
    PUSHING_FORCE,
    RADIUS,
    SPEED,
    STROKE,
    Quantity,
    require_count,
)
from sainet.worlds.noise_config import NoiseConfig, NoiseLevel

Setup = Literal["robot", "direct-force"]
_RIGHT_ANGLE = 90  # degrees

Range = tuple[float] | tuple[float, float]

_COUNTS = {
    "disks": (1, MOST_DISKS),
    "pushes": (1, MOST_PUSHES),
    "chunk_size": (1, MOST_PUSHES),
    "force_steps": (1, MOST_STEPS),
    "hold_steps": (0, MOST_STEPS),
    "seed": (0, LARGEST_COUNT),
}
_RANGES = {
    "mass_kg": MASS,
    "radius_mm": RADIUS.times(1000, "mm"),
    "stroke_mm": STROKE.times(1000, "mm"),
    "speed_mm_s": SPEED.times(1000, "mm/s"),
    "table_friction": FRICTION,
    "contact_friction": FRICTION,
}
_QUANTITIES = {
    "pusher_radius_mm": PUSHER_RADIUS.times(1000, "mm"),
    "force_n": PUSHING_FORCE,
    "gap_mm": GAP.times(1000, "mm"),
}


@dataclass(frozen=True, kw_only=True)
class GenerateConfig:
    """Simulated pushes with the distributions of the paper (section IV-B).

    A range is a uniform distribution between two numbers, or one constant.
    """

    setup: Positional[Setup] = "robot"
    """Setup: robot (the pusher follows a path) or direct-force (a force drives it)."""
    disks: int = 2
    """Number of disks."""
    pushes: int = 4500
    """Number of pushes."""
    engine: str = "planar"
    """Engine of the ground truth: planar or bullet."""
    assumed_engine: tuple[str, ...] = ("planar",)
    """Engines of the stored simulator predictions: planar or bullet with the paper's
    assumed properties, planar-true or bullet-true with the true masses and
    radii."""
    seed: int = 0
    """Random seed; equal seeds give byte-identical datasets."""
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
    gap_mm: float = 0.0
    """Initial gap between neighbouring disks, and between disk 1 and pusher (mm)."""
    stroke_mm: Range = (10.0,)
    """Stroke of a push (mm, range; robot)."""
    speed_mm_s: Range = (50.0,)
    """Speed of a push (mm/s, range; robot)."""
    hold_steps: int = 152
    """Number of steps after the stroke (robot). The total, 48 + 152 = 200 with the
    defaults, is rounded up to a multiple of 40."""
    force_n: float = 8.0
    """Force on the pusher (N; direct force)."""
    force_steps: int = 480
    """Number of steps with force (direct force), 1/240 s each."""
    noise_level: NoiseLevel = "default"
    """Scale of all noise; paper-like is three times the default."""
    noise: NoiseConfig = field(default_factory=NoiseConfig)
    """The sources of noise."""
    chunk_size: int = 250
    """Number of pushes per chunk, which are simulated, written and read together."""

    def __post_init__(self) -> None:
        """Check every setting."""
        require_one_of("setup", self.setup, get_args(Setup))
        require_one_of("noise_level", self.noise_level, get_args(NoiseLevel))
        require_one_of("engine", self.engine, ENGINES)
        for name in self.assumed_engine:
            require_one_of("assumed_engine", name, SIMULATORS)
        different = len(set(self.assumed_engine)) == len(self.assumed_engine) > 0
        wanted = "one or more different names"
        require(different, "assumed_engine", wanted, self.assumed_engine)
        for name, (low, high) in _COUNTS.items():
            require_count(name, getattr(self, name), low=low, high=high)
        for name, quantity in _RANGES.items():
            _check_range(name, getattr(self, name), quantity)
        for name, quantity in _QUANTITIES.items():
            quantity.require(name, getattr(self, name))
        for name in ("contact_angle_deg", "direction_deg", "placement_deg"):
            value = getattr(self, name)
            require(0 <= value < _RIGHT_ANGLE, name, "from 0 to below 90", value)


def bounds(values: Range) -> tuple[float, float]:
    """Return the low and the high end of a range of one or two numbers."""
    return values[0], values[-1]


def _check_range(name: str, values: Range, quantity: Quantity) -> None:
    require(len(values) in (1, 2), name, "one number or two", values)
    quantity.require(name, values)
    require(values[0] <= values[-1], name, "a range, low before high", values)
