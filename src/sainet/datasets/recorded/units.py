"""Units of the columns of an own table, and their conversion to m, rad and s."""

import math
from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    from sainet.datasets.recorded.tables import Table

_LENGTHS = ("x", "y", "pusher_x", "pusher_y")
# Divisors, not factors: 300 / 1000 is the number that 0.3 spells, so that the same
# pushes in other units have the same hashes.
_DIVISORS = {
    "length_unit": {"m": 1.0, "mm": 1000.0},
    "angle_unit": {"rad": 1.0, "deg": 180 / math.pi},
    "time_unit": {"s": 1.0, "ms": 1000.0},
}


@dataclass(frozen=True, kw_only=True)
class Units:
    """Units of a table; its properties are always in kg and m."""

    length_unit: Literal["m", "mm"] = "m"
    """Unit of x, y, pusher_x and pusher_y in a table. The properties are in m."""
    angle_unit: Literal["rad", "deg"] = "rad"
    """Unit of the angles in a table."""
    time_unit: Literal["s", "ms"] = "s"
    """Unit of the times in a table."""

    @property
    def settings(self) -> dict[str, str]:
        """The units that differ from m, rad and s, as settings of a run folder."""
        known = asdict(Units())
        return {
            name: unit for name, unit in asdict(self).items() if unit != known[name]
        }

    def to_si(self, table: "Table") -> "Table":
        """Return the table in m, rad and s."""
        columns = dict.fromkeys(_LENGTHS, "length_unit")
        columns |= {"angle": "angle_unit", "time": "time_unit"}
        units = asdict(self)
        numbers = {
            name: values / _DIVISORS[columns[name]][units[columns[name]]]
            for name, values in table.numbers.items()
        }
        return replace(table, numbers=numbers)
