"""Limits of the motion that is sent to a robot."""

from math import ceil
from typing import Annotated

import msgspec
import numpy as np
from jaxtyping import Float

from sainet.runs.errors import BadInput
from sainet.scenes.quantities import Quantity

CYCLE = 0.004032  # s, of ABB's controllers: one message and one answer

SPEED_LIMIT = Quantity("speed limit", "m/s", 1e-3, 1.0, "mm/s")
LINE_LIMIT = Quantity("distance from the path", "m", 1e-4, 0.05, "millimetres")
LAG = Quantity("lag", "s", CYCLE, 0.5, "milliseconds")
FEEDBACK_AGE = Quantity("age of feedback", "cycles", 1.5, 25.0)
COORDINATE = Quantity("coordinate", "m", -10.0, 10.0, "millimetres")

Coordinate = Annotated[float, COORDINATE.meta]
Corner = tuple[Coordinate, Coordinate, Coordinate]  # m, in the base frame


class Stopped(Exception):  # noqa: N818
    """Motion was stopped or refused; the message is the recorded reason."""


class BadLimits(BadInput, ValueError):
    """Limits that contradict each other; a ValueError names its field in documents."""


class Limits(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Workspace, speed and watchdog limits of one robot, in its base frame.

    Raises:
        BadInput: a side of the workspace is reversed or empty.
    """

    low: Corner
    high: Corner
    speed: Annotated[float, SPEED_LIMIT.meta]  # m/s
    line: Annotated[float, LINE_LIMIT.meta]  # m, of the arm from the path
    lag: Annotated[float, LAG.meta] = 0.08  # s, longest delay of the arm
    age: Annotated[float, FEEDBACK_AGE.meta] = 3.0  # cycles, of the last feedback

    def __post_init__(self) -> None:
        """Check the corners."""
        for axis, low, high in zip("xyz", self.low, self.high, strict=True):
            if not low < high:
                raise BadLimits(
                    f"the workspace is empty: low {axis} is {low:g} m and high {axis} "
                    f"is {high:g} m; low must be below high."
                )

    @property
    def step(self) -> float:
        """The longest step (m) between two answers, with room for rounding errors."""
        return self.speed * CYCLE * (1 + 1e-9)

    @property
    def lag_cycles(self) -> int:
        """The longest delay of the arm, in cycles."""
        return ceil(self.lag / CYCLE)

    def contain(self, point: Float[np.ndarray, "3"]) -> bool:
        """Return whether a point (m) is inside the workspace; NaN is not."""
        x, y, z = point.tolist()
        (a, b, c), (d, e, f) = self.low, self.high
        return a <= x <= d and b <= y <= e and c <= z <= f

    def rows(
        self, start: Float[np.ndarray, "3"], path: Float[np.ndarray, "time 3"]
    ) -> Float[np.ndarray, "row 3"]:
        """Return the positions to send: to the path, along it, and its end held.

        Args:
            start: where the arm is (m).
            path: positions (m), one for each cycle.

        Raises:
            Stopped: a row is outside the workspace or too far from the row before, or
                the path does not start at the arm.
        """
        # An arm that rests on the border is a little outside of it half of the time.
        rest = np.clip(start, self.low, self.high)
        if not np.linalg.norm(start - rest) <= self.step:
            raise Stopped(f"the arm, at {in_mm(start)}, is outside the workspace")
        if not len(path):
            raise Stopped("refused: the path is empty")
        inside = ((path >= self.low) & (path <= self.high)).all(axis=1)
        if not inside.all():
            row = int(np.argmin(inside))
            raise Stopped(
                f"refused: row {row} of the path, {in_mm(path[row])}, is outside the "
                "workspace"
            )
        steps = np.linalg.norm(np.diff(path, axis=0), axis=1)
        if (steps > self.step).any():
            row = int(np.argmax(steps > self.step))
            raise Stopped(
                f"refused: row {row + 1} of the path is {1000 * steps[row]:.3f} mm "
                f"from the row before; the speed limit is {1000 * self.step:.3f} mm a "
                "cycle"
            )
        gap = float(np.linalg.norm(path[0] - rest))
        if gap > self.line:
            raise Stopped(
                f"refused: the path starts {1000 * gap:.1f} mm from the arm; the limit "
                f"is {1000 * self.line:.1f} mm"
            )
        approach = np.linspace(rest, path[0], ceil(gap / self.step), endpoint=False)
        return np.concatenate([approach, path, [path[-1]] * self.lag_cycles])


def in_mm(point: Float[np.ndarray, "3"]) -> str:
    """Return a point (m) as text in millimetres."""
    return "({:.1f}, {:.1f}, {:.1f}) mm".format(*(1000 * point))
