"""One push as the truth and the models have it: what a replay and a figure draw."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float


@dataclass(frozen=True, eq=False)
class Track:
    """One account of a push, from its initial state on; NaN where not observed."""

    position: Float[np.ndarray, "time body 2"]  # m, time is the steps plus one
    angle: Float[np.ndarray, "time body"]  # rad, counter-clockwise
    pusher: Float[np.ndarray, "time 2"]  # m

    def __post_init__(self) -> None:
        """Check that the three fields tell of the same steps and bodies."""
        time, body = self.angle.shape
        shapes = self.position.shape, self.pusher.shape
        if shapes != ((time, body, 2), (time, 2)):
            raise ValueError(
                f"position {shapes[0]} and pusher {shapes[1]} do not fit angle "
                f"{self.angle.shape}; they must be [time, body, 2] and [time, 2]"
            )


@dataclass(frozen=True, eq=False)
class Replay:
    """Several accounts of the same push; the first track is the reference."""

    title: str
    time_step: float  # s
    radius: tuple[float, ...]  # m, of each disk
    pusher_radius: float  # m
    tracks: dict[str, Track]  # by model, the truth first

    def __post_init__(self) -> None:
        """Check that there is a reference and that all tracks are alike."""
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
        """The track that the others are compared with."""
        return next(iter(self.tracks.values()))

    def errors_mm(self, model: str) -> Float[np.ndarray, "time body"]:
        """Return how far a model's disks are from the reference (mm)."""
        offset = self.tracks[model].position - self.reference.position
        return 1e3 * np.linalg.norm(offset, axis=-1)

    def final_turn_deg(self, model: str) -> Float[np.ndarray, " body"]:
        """Return the absolute error of each disk's angle at the end (degrees)."""
        offset = self.tracks[model].angle[-1] - self.reference.angle[-1]
        return np.degrees(np.abs(np.arctan2(np.sin(offset), np.cos(offset))))
