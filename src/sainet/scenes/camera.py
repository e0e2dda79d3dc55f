"""Camera offsets: where a camera measures things, minus where the robot has them."""

from typing import Annotated

import msgspec

from sainet.scenes.quantities import CAMERA_OFFSET

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
