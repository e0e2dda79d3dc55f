"""Hidden parameters of a virtual lab, drawn from stated ranges.

No model is given them. The ranges were fixed before any network was evaluated in a lab;
docs/virtual-lab.md names the source of each.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from sainet.engines.simulator import PAPER_MASS, PAPER_RADIUS
from sainet.robots import SURFACES, Surface

LABS = 5
_LAB = 0x1AB
_WAVES = 128  # Fourier features of a field
_HARMONICS = 12  # of the friction around a disk
_Range = tuple[float, float]


@dataclass(frozen=True)
class Ranges:
    """Ranges that labs draw hidden parameters from, uniformly."""

    friction: _Range
    """Mean friction between a disk and the table."""
    anisotropy: _Range
    """Amplitude of the change of table friction with the direction of sliding."""
    variation: _Range = (0.2, 0.35)
    """Standard deviation of table friction over the table (fraction of its mean)."""
    variation_length: _Range = (0.03, 0.06)
    """Correlation length of that variation (m)."""
    pusher_friction: _Range = (0.25, 0.8)
    """Mean friction between the pusher and a disk."""
    rim_variation: _Range = (0.2, 0.5)
    """Standard deviation of the logarithm of that friction around a disk."""
    push_variation: _Range = (0.2, 0.4)
    """The same from push to push."""
    disk_friction: _Range = (0.2, 0.6)
    """Friction between disks."""
    feet: tuple[int, int] = (4, 8)
    """Number of points on which a disk rests, both ends included."""
    foot_place: _Range = (0.4, 0.95)
    """Distance of these points from the centre (fraction of the radius)."""
    mass_error: _Range = (-0.005, 0.005)
    """True minus nominal mass (fraction)."""
    radius_error: _Range = (-1e-4, 1e-4)
    """True minus nominal radius (m)."""
    registration: _Range = (3e-4, 8e-4)
    """Standard deviation of the offset between tracker and robot, each axis (m)."""
    distortion: _Range = (3e-4, 8e-4)
    """Standard deviation of the change of that offset over the table (m)."""
    distortion_length: _Range = (0.05, 0.08)
    """Correlation length of that change (m)."""
    arm_frequency: _Range = (10.0, 25.0)
    """Natural frequency of the arm's position control (Hz), critically damped."""
    arm_delay: _Range = (0.010, 0.020)
    """Time from a command to the beginning of its execution (s)."""
    arm_error: _Range = (5e-5, 1.5e-4)
    """Standard deviation of the arm's path about its command (m)."""
    capture_noise: _Range = (1e-4, 2e-4)
    """Standard deviation of measured positions (m)."""
    capture_noise_angle: _Range = (1e-3, 2.5e-3)
    """Standard deviation of measured angles (rad)."""
    capture_rate: _Range = (100.0, 250.0)
    """Rate of motion capture (Hz)."""
    capture_delay: _Range = (0.002, 0.008)
    """Age of a pose at its time stamp (s)."""


RANGES: dict[Surface, Ranges] = {
    "abs": Ranges(friction=(0.12, 0.18), anisotropy=(0.05, 0.15)),
    "plywood": Ranges(friction=(0.2, 0.3), anisotropy=(0.15, 0.3)),
}


@dataclass(frozen=True)
class Field:
    """A Gaussian random field over the table, of mean zero."""

    wave: Float[np.ndarray, "wave 2"]  # rad/m
    phase: Float[np.ndarray, " wave"]  # rad
    deviation: float

    @classmethod
    def draw(cls, rng: np.random.Generator, deviation: float, length: float) -> "Field":
        """Return a field with a Gaussian correlation of a length (m)."""
        wave = rng.standard_normal((_WAVES, 2)) / length
        return cls(wave, rng.uniform(0, 2 * np.pi, _WAVES), deviation)

    def at(self, place: Float[np.ndarray, "*batch 2"]) -> Float[np.ndarray, "*batch"]:
        """Return the values at places (m)."""
        waves = np.cos(place @ self.wave.T + self.phase)
        return self.deviation * np.sqrt(2 / _WAVES) * waves.sum(-1)


@dataclass(frozen=True)
class Disk:
    """A steel disk: its properties, the points it rests on, its rim."""

    mass: float  # kg
    radius: float  # m
    feet: Float[np.ndarray, "foot 2"]  # m, in the frame of the disk
    rim: Float[np.ndarray, "2 harmonic"]  # of the logarithm of friction

    def rim_friction(self, side: float) -> float:
        """Return the factor of friction at an angle of the disk (rad); mean one."""
        angle = side * np.arange(1, self.rim.shape[1] + 1)
        swing = self.rim[0] @ np.cos(angle) + self.rim[1] @ np.sin(angle)
        return float(np.exp(swing - (self.rim**2).sum() / 4))


@dataclass(frozen=True)
class Table:
    """A surface whose friction varies with place and direction."""

    friction: float
    variation: Field
    anisotropy: float
    grain: float  # rad, direction of the largest friction

    def friction_at(
        self,
        place: Float[np.ndarray, "*batch 2"],
        velocity: Float[np.ndarray, "*batch 2"],
    ) -> Float[np.ndarray, "*batch"]:
        """Return the friction of points that slide, at least a tenth of the mean."""
        heading = np.arctan2(velocity[..., 1], velocity[..., 0])
        turned = 1 + self.anisotropy * np.cos(2 * (heading - self.grain))
        factor = (1 + self.variation.at(place)) * turned
        return self.friction * np.maximum(factor, 0.1)


@dataclass(frozen=True)
class Arm:
    """Position control of the pusher."""

    frequency: float  # Hz
    delay: float  # s
    error: float  # m


@dataclass(frozen=True)
class Capture:
    """Motion capture, whose frame differs from the robot's."""

    offset: Float[np.ndarray, " 2"]  # m
    distortion: tuple[Field, Field]  # m, of x and y
    noise: float  # m
    noise_angle: float  # rad
    rate: float  # Hz
    delay: float  # s

    def seen(
        self, pose: Float[np.ndarray, "*batch 3"]
    ) -> Float[np.ndarray, "*batch 3"]:
        """Return poses in the tracker's frame, without noise, from the robot's."""
        place = pose[..., :2]
        moved = np.stack([each.at(place) for each in self.distortion], -1)
        return np.concatenate([place + self.offset + moved, pose[..., 2:]], -1)

    def unseen(
        self, pose: Float[np.ndarray, "*batch 3"]
    ) -> Float[np.ndarray, "*batch 3"]:
        """Return the inverse of `seen`; the distortion changes little over itself."""
        found = pose
        for _ in range(5):
            found = found + pose - self.seen(found)
        return found

    def measured(
        self, rng: np.random.Generator, pose: Float[np.ndarray, "*batch 3"]
    ) -> Float[np.ndarray, "*batch 3"]:
        """Return measured poses, from poses in the robot's frame."""
        size = np.array([self.noise, self.noise, self.noise_angle])
        return self.seen(pose) + size * rng.standard_normal(pose.shape)


@dataclass(frozen=True)
class Lab:
    """Everything that is hidden from models."""

    number: int
    surface: Surface
    table: Table
    disks: tuple[Disk, ...]  # disk 1 is pushed
    pusher_friction: float
    push_variation: float
    disk_friction: float
    arm: Arm
    capture: Capture

    def friction_of_push(
        self,
        rng: np.random.Generator,
        pose: Float[np.ndarray, " 3"],
        pusher: Float[np.ndarray, " 2"],
    ) -> float:
        """Draw the friction between the pusher and disk 1 where they will touch."""
        x, y, angle = pose
        side = float(np.arctan2(y - pusher[1], x - pusher[0]) - angle)
        mean = self.pusher_friction * self.disks[0].rim_friction(side)
        scatter = self.push_variation
        return mean * float(np.exp(scatter * rng.standard_normal() - scatter**2 / 2))


def draw_lab(number: int, surface: Surface, *, order: tuple[int, ...] = (0, 1)) -> Lab:
    """Return a virtual lab; labs of one number share all but the surface.

    Args:
        number: of the lab, from 0.
        surface: of its table.
        order: which of the paper's disks is disk 1, disk 2 and so on.
    """
    ranges = RANGES[surface]

    def generator(*part: int) -> np.random.Generator:
        return np.random.default_rng([_LAB, number, *part])

    return Lab(
        number,
        surface,
        _table(generator(0, SURFACES.index(surface)), ranges),
        tuple(_disk(generator(1, which), ranges, which) for which in order),
        **_contact(generator(2), ranges),
        arm=_arm(generator(3), ranges),
        capture=_capture(generator(4), ranges),
    )


def _table(rng: np.random.Generator, ranges: Ranges) -> Table:
    deviation, length = rng.uniform(*ranges.variation), ranges.variation_length
    return Table(
        friction=rng.uniform(*ranges.friction),
        variation=Field.draw(rng, deviation, rng.uniform(*length)),
        anisotropy=rng.uniform(*ranges.anisotropy),
        grain=rng.uniform(0, np.pi),
    )


def _disk(rng: np.random.Generator, ranges: Ranges, which: int) -> Disk:
    radius = PAPER_RADIUS[which] + rng.uniform(*ranges.radius_error)
    count = int(rng.integers(*ranges.feet, endpoint=True))
    # Evenly around the disk, each up to 0.3 of the spacing away.
    angle = 2 * np.pi / count * (np.arange(count) + rng.uniform(-0.3, 0.3, count))
    reach = radius * rng.uniform(*ranges.foot_place, count)
    deviation = rng.uniform(*ranges.rim_variation) / np.sqrt(_HARMONICS)
    return Disk(
        mass=PAPER_MASS[which] * (1 + rng.uniform(*ranges.mass_error)),
        radius=radius,
        feet=reach[:, None] * np.stack([np.cos(angle), np.sin(angle)], -1),
        rim=deviation * rng.standard_normal((2, _HARMONICS)),
    )


def _contact(rng: np.random.Generator, ranges: Ranges) -> dict[str, float]:
    names = ("pusher_friction", "push_variation", "disk_friction")
    return {name: rng.uniform(*getattr(ranges, name)) for name in names}


def _arm(rng: np.random.Generator, ranges: Ranges) -> Arm:
    bounds = (ranges.arm_frequency, ranges.arm_delay, ranges.arm_error)
    return Arm(*(rng.uniform(*each) for each in bounds))


def _capture(rng: np.random.Generator, ranges: Ranges) -> Capture:
    deviation, length = rng.uniform(*ranges.distortion), ranges.distortion_length
    return Capture(
        offset=rng.uniform(*ranges.registration) * rng.standard_normal(2),
        distortion=(
            Field.draw(rng, deviation, rng.uniform(*length)),
            Field.draw(rng, deviation, rng.uniform(*length)),
        ),
        noise=rng.uniform(*ranges.capture_noise),
        noise_angle=rng.uniform(*ranges.capture_noise_angle),
        rate=rng.uniform(*ranges.capture_rate),
        delay=rng.uniform(*ranges.capture_delay),
    )
