"""Settings of simulated datasets, free of JAX."""

from dataclasses import asdict, dataclass, field
from typing import Literal, get_args

from tyro.conf import Positional

from sainet.engines import ASSUMED_ENGINES, ENGINES
from sainet.runs.errors import require_option
from sainet.worlds.noise_config import NoiseConfig, NoiseLevel

Setup = Literal["robot", "direct-force"]
_RIGHT_ANGLE = 90  # degrees

Range = tuple[float] | tuple[float, float]


@dataclass(frozen=True, kw_only=True)
class GenerateConfig:
    """Simulated pushes with the distributions of the paper (section IV-B).

    A range is two numbers, drawn from uniformly, or one that is always taken.
    """

    setup: Positional[Setup] = "robot"
    """robot: the pusher follows a path. direct-force: a force drives it."""
    disks: int = 2
    """Number of disks."""
    pushes: int = 4500
    """Number of pushes."""
    engine: str = "planar"
    """Engine that makes the truth."""
    assumed_engine: tuple[str, ...] = ("planar",)
    """Engines that predict s-bar: planar or bullet with the paper's assumed properties,
    planar-calibrated or bullet-calibrated with the true masses and radii."""
    seed: int = 0
    """Of everything random; the same seed gives the same bytes."""
    mass_kg: Range = (0.85, 1.15)
    """Mass of a disk."""
    radius_mm: Range = (50.0, 60.0)
    """Radius of a disk."""
    table_friction: Range = (0.05, 0.25)
    """Friction between disks and table, one value for each push."""
    contact_friction: Range = (0.25,)
    """Friction between disks, and between disk and pusher."""
    pusher_radius_mm: float = 4.8
    """Radius of the pusher."""
    contact_angle_deg: float = 60.0
    """Greatest contact angle, to either side of the back of disk 1."""
    direction_deg: float = 30.0
    """Greatest angle between the push and the contact normal, to either side."""
    placement_deg: float = 60.0
    """Greatest angle at which a disk is placed in front of another."""
    gap_mm: float = 0.0
    """Gap between touching disks, and between disk 1 and the pusher, at the start."""
    stroke_mm: Range = (10.0,)
    """Length of a push (robot)."""
    speed_mm_s: Range = (50.0,)
    """Speed of a push (robot)."""
    hold_steps: int = 152
    """Steps that follow the stroke (robot): 48 + 152 = 200. The sum is rounded up to
    whole 40s."""
    force_n: float = 8.0
    """Force on the pusher (direct force)."""
    force_steps: int = 480
    """Steps that the force lasts (direct force): 2 s."""
    noise_level: NoiseLevel = "default"
    """Size of all noise: none, default or paper-like (three times the default)."""
    noise: NoiseConfig = field(default_factory=NoiseConfig)
    """The sources of noise."""
    chunk_size: int = 250
    """Pushes that are simulated, written and read at a time."""

    def __post_init__(self) -> None:
        """Refuse settings that no scene can have."""
        _require_one_of("setup", self.setup, get_args(Setup))
        _require_one_of("noise-level", self.noise_level, get_args(NoiseLevel))
        _require_one_of("engine", self.engine, tuple(ENGINES))
        for name in self.assumed_engine:
            _require_one_of("assumed-engine", name, ASSUMED_ENGINES)
        unlike = len(set(self.assumed_engine)) == len(self.assumed_engine) > 0
        require_option(
            unlike, "assumed-engine", "one or more unlike names", self.assumed_engine
        )
        for name in ("disks", "pushes", "chunk_size", "force_steps"):
            require_option(
                getattr(self, name) >= 1, name, "at least 1", getattr(self, name)
            )
        require_option(
            self.hold_steps >= 0, "hold-steps", "at least 0", self.hold_steps
        )
        require_option(self.seed >= 0, "seed", "at least 0", self.seed)
        for name in ("mass_kg", "radius_mm", "stroke_mm", "speed_mm_s"):
            _check_range(name, getattr(self, name), positive=True)
        for name in ("table_friction", "contact_friction"):
            _check_range(name, getattr(self, name), positive=False)
        for name in ("pusher_radius_mm", "force_n"):
            value = getattr(self, name)
            require_option(_finite(value) and value > 0, name, "positive", value)
        for name in ("contact_angle_deg", "direction_deg", "placement_deg"):
            value = getattr(self, name)
            require_option(0 <= value < _RIGHT_ANGLE, name, "from 0 to below 90", value)
        require_option(
            _finite(self.gap_mm) and self.gap_mm >= 0,
            "gap-mm",
            "zero or positive (disks must not overlap)",
            self.gap_mm,
        )
        _check_noise(self.noise)


def bounds(values: Range) -> tuple[float, float]:
    """Return the low and the high end of a range of one or two numbers."""
    return values[0], values[-1]


def _check_range(name: str, values: Range, *, positive: bool) -> None:
    wanted = "positive, low before high" if positive else "0 or more, low before high"
    good = len(values) in (1, 2) and all(map(_finite, values))
    good = good and (values[0] > 0 if positive else values[0] >= 0)
    require_option(good and values[0] <= values[-1], name, wanted, values)


def _check_noise(noise: NoiseConfig) -> None:
    for name, value in asdict(noise).items():
        scale = name in ("correlation_time", "friction_length_mm")
        good = _finite(value) and (value > 0 if scale else value >= 0)
        wanted = "positive" if scale else "0 or more"
        require_option(good, name, wanted, value)


def _require_one_of(name: str, value: str, known: tuple[str, ...]) -> None:
    require_option(value in known, name, "one of " + ", ".join(known), value)


def _finite(value: float) -> bool:
    return abs(value) < float("inf")
