"""Bounds on physical values: the one place where they are stated.

Stores, cards, identified parameters, properties files, options and Python arguments all
check against these bounds. `Mass` and the other annotated types carry the bounds into
msgspec documents; `Quantity.check` applies them to numbers and arrays. Free of JAX.
"""

from contextlib import suppress
from dataclasses import dataclass, replace
from numbers import Integral
from typing import Annotated

import msgspec
import numpy as np

from sainet.runs.errors import BadInput, BadSetting

_SLACK = 1e-6  # relative, of a bound: single precision rounds


@dataclass(frozen=True)
class Quantity:
    """A physical quantity and the range that its values may have."""

    name: str
    unit: str  # empty: without a dimension
    low: float
    high: float
    mistaken_for: str = ""  # the unit that values above the range are usually in
    remedy: str = ""  # what the user can do about other values, without a full stop

    @property
    def wanted(self) -> str:
        """The range in words: "from 0.001 to 100 kg"."""
        return f"from {self.low:g} to {self.high:g} {self.unit}".rstrip()

    @property
    def meta(self) -> msgspec.Meta:
        """The range as msgspec checks it when it decodes (JSON holds no NaN)."""
        return msgspec.Meta(ge=self.low, le=self.high)

    def times(self, factor: float, unit: str) -> "Quantity":
        """Return the quantity in a unit that is `factor` times smaller."""
        low, high = self.low * factor, self.high * factor
        return replace(self, unit=unit, low=low, high=high, mistaken_for="")

    def accepts(self, values: object) -> bool:
        """Return whether a number, or every number of an array, is in the range."""
        return self._first_outside(values) is None

    def check(
        self,
        values: object,
        where: str,
        *,
        error: type[BadInput] = BadInput,
        remedy: str = "",
    ) -> None:
        """Raise an error unless all values are in the range.

        Args:
            values: a number or an array.
            where: file and field, or the argument, as the message is to name it.
            error: to raise.
            remedy: instead of the quantity's own.

        Raises:
            BadInput: or the given subclass, with the value, its range and the remedy.
        """
        value = self._first_outside(values)
        if value is None:
            return
        looks = self.mistaken_for and value > self.high
        hint = f" (in {self.mistaken_for}?)" if looks else ""
        raise error(
            f"{where} is {value:g}{hint}; it must be {self.wanted}"
            + (f"; {remedy or self.remedy}".rstrip("; ") + ".")
        )

    def require(self, name: str, values: object) -> None:
        """Raise `BadSetting` unless all values of a setting are in the range."""
        with suppress(ValueError):  # of rows of different lengths
            if np.asarray(values).dtype.kind in "biuf":
                value = self._first_outside(values)
                if value is None:
                    return
                raise BadSetting(name, f"{value:g}", self.wanted)
        raise BadSetting(name, values, f"a number {self.wanted}")

    def _first_outside(self, values: object) -> float | None:
        numbers = np.asarray(values, np.float64)
        low, high = self.low - _SLACK * abs(self.low), self.high + _SLACK * self.high
        bad = ~((numbers >= low) & (numbers <= high))  # NaN as well
        return float(numbers[bad].flat[0]) if bad.any() else None


MASS = Quantity("mass", "kg", 1e-3, 100.0, "grams")
RADIUS = Quantity("radius", "m", 1e-3, 1.0, "millimetres")
PUSHER_RADIUS = Quantity("pusher radius", "m", 1e-4, 1.0, "millimetres")
FRICTION = Quantity("friction", "", 0.0, 10.0)
PRESSURE_RATIO = Quantity("pressure radius ratio", "", 0.01, 1.0)
CAMERA_OFFSET = Quantity("camera offset", "mm", -100.0, 100.0)
POSITION = Quantity("position", "m", -100.0, 100.0, "millimetres")
ANGLE = Quantity("angle", "rad", -1e4, 1e4)
CONTACT_ANGLE = Quantity("contact angle", "rad", -np.pi, np.pi, "degrees")
DIRECTION = Quantity("push direction", "rad", -np.pi / 2, np.pi / 2, "degrees")
VELOCITY = Quantity("velocity", "m/s", -100.0, 100.0, "mm/s")
SPIN = Quantity("spin", "rad/s", -1e4, 1e4)
FORCE = Quantity("force", "N", -1e4, 1e4)
PUSHING_FORCE = Quantity("pushing force", "N", 1e-6, 1e4)
PUSHER_MASS = Quantity("pusher mass", "kg", 1e-3, 1e4, "grams")
DAMPING = Quantity("damping", "N s/m", 0.0, 1e6)
# Of a pusher of 10 kg, whose explicit steps diverge from 2,400 N s/m on.
STABLE_DAMPING = Quantity("damping", "N s/m", 0.0, 2000.0)
STROKE = Quantity("stroke", "m", 1e-4, 1.0, "millimetres")
SPEED = Quantity("speed", "m/s", 1e-4, 10.0, "mm/s")
ALIGNMENT = Quantity("alignment weight", "m", 0.0, 1e4)
START_GAP = Quantity("gap", "m", -0.005, 1.0, "millimetres")  # negative: an overlap
LENGTH_DEVIATION = Quantity("standard deviation", "m", 0.0, 0.1, "millimetres")
ANGLE_DEVIATION = Quantity("standard deviation", "deg", 0.0, 90.0)
FRACTION = Quantity("fraction", "", 0.0, 10.0)
CORRELATION_TIME = Quantity("correlation time", "s", 1e-4, 1e4)
CORRELATION_LENGTH = Quantity("correlation length", "m", 1e-4, 100.0, "millimetres")
TIME_STEP_RANGE = Quantity("time step", "s", 1e-5, 0.1, "milliseconds")

# Of a scene, by the names of its fields: disks, frictions, pusher.
PROPERTIES = {
    "mass": MASS,
    "radius": RADIUS,
    "table_friction": FRICTION,
    "disk_friction": FRICTION,
    "pusher_friction": FRICTION,
    "pusher_radius": PUSHER_RADIUS,
}

Mass = Annotated[float, MASS.meta]  # kg
Radius = Annotated[float, RADIUS.meta]  # m
Friction = Annotated[float, FRICTION.meta]
PressureRatio = Annotated[float, PRESSURE_RATIO.meta]
TimeStep = Annotated[float, TIME_STEP_RANGE.meta]  # s

Finite = Annotated[float, msgspec.Meta(ge=-1e9, le=1e9)]  # of any quantity
Size = Annotated[float, msgspec.Meta(ge=0.0, le=1e9)]  # of an error or a duration

MOST_DISKS = 100  # of a scene
MOST_PUSHES = 10_000_000  # of a dataset
MOST_STEPS = 100_000  # of a push
LARGEST_COUNT = 2**63 - 1  # of a document
LARGEST_SEED = 2**32 - 1  # JAX and NumPy take 32 bits as one word


def require_count(
    name: str, value: object, *, low: int = 1, high: int = LARGEST_COUNT
) -> None:
    """Raise `BadSetting` unless a setting is a whole number in a range."""
    if not isinstance(value, Integral):  # text and None cannot be compared
        raise BadSetting(name, value, f"a whole number from {low} to {high}")
    if not low <= int(value) <= high:
        wanted = f"at least {low}" if int(value) < low else f"from {low} to {high}"
        raise BadSetting(name, value, wanted)


def require_seed(seed: object) -> None:
    """Raise `BadSetting` unless a seed is a whole number of 32 bits."""
    require_count("seed", seed, low=0, high=LARGEST_SEED)
