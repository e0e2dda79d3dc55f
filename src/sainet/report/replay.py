"""One push with its ground truth and predictions, for replays and figures."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float


@dataclass(frozen=True, eq=False)
class Track:
    """The motion of one push from its initial state; NaN where not observed."""

    position: Float[np.ndarray, "time body 2"]  # m, time is the steps plus one
    angle: Float[np.ndarray, "time body"]  # rad, counter-clockwise
    pusher: Float[np.ndarray, "time 2"]  # m

    def __post_init__(self) -> None:
        """Check that the three fields have the same steps and bodies."""
        time, body = self.angle.shape
        shapes = self.position.shape, self.pusher.shape
        if shapes != ((time, body, 2), (time, 2)):
            raise ValueError(
                f"position {shapes[0]} and pusher {shapes[1]} do not fit angle "
                f"{self.angle.shape}; they must be [time, body, 2] and [time, 2]"
            )


@dataclass(frozen=True, eq=False)
class Replay:
    """Tracks of the same push; the first is the reference."""

    title: str
    time_step: float  # s
    radius: tuple[float, ...]  # m, of each disk
    pusher_radius: float  # m
    tracks: dict[str, Track]  # by model, the truth first

    def __post_init__(self) -> None:
        """Check that there is a reference and that all tracks have one shape."""
        shapes = {track.angle.shape for track in self.tracks.values()}
        if len(shapes) != 1:
            raise ValueError(f"a replay needs tracks of one shape, not {shapes}")
        if shapes.pop()[1] != self.body_count:
            raise ValueError(f"the tracks do not have {self.body_count} bodies")

    @property
    def body_count(self) -> int:
        """The number of disks."""
        return len(self.radius)

    @property
    def reference(self) -> Track:
        """The track with which the others are compared."""
        return next(iter(self.tracks.values()))

    def errors_mm(self, model: str) -> Float[np.ndarray, "time body"]:
        """Return the position errors of a model's disks (mm)."""
        offset = self.tracks[model].position - self.reference.position
        return 1e3 * np.linalg.norm(offset, axis=-1)

    def final_turn_deg(self, model: str) -> Float[np.ndarray, " body"]:
        """Return the absolute final angle error of each disk (degrees)."""
        offset = self.tracks[model].angle[-1] - self.reference.angle[-1]
        return np.degrees(np.abs(np.arctan2(np.sin(offset), np.cos(offset))))
