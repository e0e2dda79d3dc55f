"""Settings of simulated datasets whose disks and friction never vary."""

from dataclasses import dataclass

from sainet.datasets.config import GenerateConfig
from sainet.engines.simulator import PAPER_FRICTION, PAPER_MASS, PAPER_RADIUS
from sainet.runs.errors import require
from sainet.scenes.quantities import MASS, RADIUS
from sainet.worlds.config import OfDisks, Range


@dataclass(frozen=True, kw_only=True)
class FixedConfig(GenerateConfig):
    """Simulated pushes of the same disks every time: those that engines assume."""

    mass_of_each_kg: tuple[float, ...] = PAPER_MASS
    """Mass of each disk (kg)."""
    radius_of_each_mm: tuple[float, ...] = tuple(1000 * r for r in PAPER_RADIUS)
    """Radius of each disk (mm)."""
    table_friction: Range = (PAPER_FRICTION,)
    """Friction coefficient between disks and table."""

    def __post_init__(self) -> None:
        """Check every setting.

        Raises:
            BadSetting: a value is out of its range, or there is not one for each disk.
        """
        super().__post_init__()
        ranges = {
            "mass_of_each_kg": MASS,
            "radius_of_each_mm": RADIUS.times(1000, "mm"),
        }
        for name, quantity in ranges.items():
            values = getattr(self, name)
            require(len(values) == self.disks, name, f"{self.disks} numbers", values)
            quantity.require(name, values)

    @property
    def masses(self) -> OfDisks:
        """The mass of each disk (kg)."""
        return (self.mass_of_each_kg,)

    @property
    def radii(self) -> OfDisks:
        """The radius of each disk (mm)."""
        return (self.radius_of_each_mm,)
