"""One executed push: what robots return and readers of recorded pushes make."""

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float

from sainet.runs.errors import BadInput

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
