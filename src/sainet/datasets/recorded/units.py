"""Units of the columns of an own table, and their conversion to m, rad and s."""

from dataclasses import asdict, dataclass, replace
from typing import Literal

import numpy as np

from sainet.datasets.recorded.tables import Table
from sainet.runs.errors import require_one_of

LengthUnit = Literal["m", "mm"]
AngleUnit = Literal["rad", "deg"]
TimeUnit = Literal["s", "ms"]
_LENGTHS = ("x", "y", "pusher_x", "pusher_y")
# Divisors, not factors: 300 / 1000 is the number that 0.3 spells, so that the same
# pushes in other units have the same hashes.
_DIVISORS = {
    **{"m": 1.0, "s": 1.0, "rad": 1.0},
    **{"mm": 1000.0, "ms": 1000.0, "deg": 180 / np.pi},
}


@dataclass(frozen=True, kw_only=True)
class Units:
    """Units of a table; the units of its properties are always kg and m."""

    length: LengthUnit = "m"  # of x, y, pusher_x and pusher_y
    angle: AngleUnit = "rad"
    time: TimeUnit = "s"

    def __post_init__(self) -> None:
        """Refuse an unknown unit."""
        require_one_of("length_unit", self.length, ("m", "mm"))
        require_one_of("angle_unit", self.angle, ("rad", "deg"))
        require_one_of("time_unit", self.time, ("s", "ms"))

    @property
    def settings(self) -> dict[str, str]:
        """The units that differ from m, rad and s, as settings of a run folder."""
        known = asdict(Units())
        return {
            f"{name}_unit": unit
            for name, unit in asdict(self).items()
            if unit != known[name]
        }

    def to_si(self, table: Table) -> Table:
        """Return the table in m, rad and s."""
        units = dict.fromkeys(_LENGTHS, self.length)
        units |= {"angle": self.angle, "time": self.time}
        numbers = {
            name: values / _DIVISORS[units[name]]
            for name, values in table.numbers.items()
        }
        return replace(table, numbers=numbers)
