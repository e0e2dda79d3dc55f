"""Recordings of executed pushes, and the offset of the camera that measures them."""

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Annotated

import msgspec
import numpy as np
from jaxtyping import Float

from sainet.runs.errors import BadInput
from sainet.scenes.quantities import CAMERA_OFFSET

if TYPE_CHECKING:
    from sainet.scenes.pushes import Push


@dataclass(frozen=True, kw_only=True)
class Conditions:
    """Circumstances of a recording by which pushes are grouped."""

    surface: str = ""  # material of the table; empty: unknown
    speed_mm_s: float | None = None  # commanded; None: unknown


@dataclass(frozen=True, kw_only=True)
class Recording:
    """Poses of the disks and the pusher during one push, on one clock.

    A source with two clocks gives the samples of both, NaN where one of them has none.

    Raises:
        BadInput: times that do not increase.
    """

    time: Float[np.ndarray, " sample"]  # s, increasing
    pose: Float[np.ndarray, "sample body 3"]  # m, m, rad; NaN where unknown
    pusher: Float[np.ndarray, "sample 2"]  # m; NaN where unknown
    commanded: "Push | None" = None  # as sent, after every limit; None: unknown
    conditions: Conditions = field(default_factory=Conditions)
    plan: str = ""  # equal for repetitions of one push; empty: unknown
    source: str = ""  # names the push in messages: file and row, for example
    trouble: str = ""  # why the push differs from the commanded push; empty: none

    def __post_init__(self) -> None:
        """Check the clock."""
        late = np.flatnonzero(~(np.diff(self.time) > 0))  # NaN as well
        if len(late):
            sample = late[0] + 1
            raise BadInput(
                f"{self.source or 'recording'}: time must increase; sample {sample} at "
                f"{self.time[sample]:g} s follows {self.time[sample - 1]:g} s."
            )

    @property
    def bodies(self) -> int:
        """The number of disks."""
        return self.pose.shape[1]


_MOST = CAMERA_OFFSET.high / 1000
Offset = Annotated[float, msgspec.Meta(ge=-_MOST, le=_MOST)]  # m


class CameraOffset(msgspec.Struct, frozen=True, kw_only=True):
    """Camera-measured minus robot-measured position, the same everywhere."""

    x: Offset = 0.0  # m
    y: Offset = 0.0  # m

    def __bool__(self) -> bool:
        """Whether camera and robot disagree."""
        return bool(self.x or self.y)

    @property
    def vector(self) -> tuple[float, float]:
        """The offset (m)."""
        return self.x, self.y


AGREES = CameraOffset()
