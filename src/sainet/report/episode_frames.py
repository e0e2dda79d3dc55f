"""Frames of pushes and of episodes, for pages, figures and the animation."""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float

from sainet.control.record import EpisodeRecord
from sainet.models.identity import ModelId
from sainet.report.palette import style_of


@dataclass(frozen=True, eq=False)
class EndRegion:
    """Where the end of a push is expected with a probability of 90 %."""

    heading: float  # rad, of the first axis of the ellipses
    axes: Float[np.ndarray, "body 2"]  # m, half axes about the predicted end
    turn: Float[np.ndarray, " body"]  # rad, half width of the interval of the angle


@dataclass(frozen=True, eq=False)
class Track:
    """The motion of one push from its initial state; NaN where not observed."""

    position: Float[np.ndarray, "time body 2"]  # m, time is the steps plus one
    angle: Float[np.ndarray, "time body"]  # rad, counter-clockwise
    pusher: Float[np.ndarray, "time 2"]  # m
    region: EndRegion | None = None  # of the end; None where it is not known

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
    models: tuple[ModelId, ...] = ()  # give the labels

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

    @property
    def has_regions(self) -> bool:
        """Whether a model states where the push ends."""
        return any(track.region for track in self.tracks.values())

    def errors_mm(self, model: str) -> Float[np.ndarray, "time body"]:
        """Return the position errors of a model's disks (mm)."""
        offset = self.tracks[model].position - self.reference.position
        return 1e3 * np.linalg.norm(offset, axis=-1)

    def final_turn_deg(self, model: str) -> Float[np.ndarray, " body"]:
        """Return the absolute final angle error of each disk (degrees)."""
        offset = self.tracks[model].angle[-1] - self.reference.angle[-1]
        return np.degrees(np.abs(np.arctan2(np.sin(offset), np.cos(offset))))


FRAMES_PER_SECOND = 30  # records hold every eighth step of 1/240 s
_FRAMES_OF_PUSH = 12  # 0.4 s: the push lasts 0.2 s, then all bodies come to rest
_STRIDE = 3  # between the drawn points of a planned path


@dataclass(frozen=True)
class EpisodeFrames:
    """Frames of an episode, 30 per second, without the decision times."""

    record: EpisodeRecord

    @cached_property
    def starts(self) -> list[int]:
        """The frame at which each push starts."""
        lengths = [1 + len(s.actual[:_FRAMES_OF_PUSH]) for s in self.record.steps]
        return [0, *np.cumsum(lengths).tolist()][: len(lengths)]

    @cached_property
    def poses(self) -> Float[np.ndarray, "frame body 3"]:
        """The pose of each disk (mm, mm, degrees)."""
        if not self.record.steps:
            return np.asarray([self.record.final], float)
        parts = [[s.observed, *s.actual[:_FRAMES_OF_PUSH]] for s in self.record.steps]
        return np.concatenate([np.asarray(part, float) for part in parts])

    @cached_property
    def pusher(self) -> Float[np.ndarray, "frame 2"]:
        """The centre of the pusher (mm); NaN where there is no push."""
        unknown = [[np.nan, np.nan]]
        parts = [s.pusher[:_FRAMES_OF_PUSH] for s in self.record.steps] or [[]]
        # While the disks are observed, the pusher is at the start of its push.
        parts = [[*(part[:1] or unknown), *part] for part in parts]
        return np.concatenate([np.asarray(part, float) for part in parts])

    @property
    def plans(self) -> list[Float[np.ndarray, "point body 2"]]:
        """The planned path of the disks' centres at each decision (mm)."""
        shape = (-1, len(self.record.radius_mm), 3)
        paths = [np.asarray(s.planned, float).reshape(shape) for s in self.record.steps]
        return [
            np.concatenate([path[::_STRIDE, :, :2], path[-1:, :, :2]]) for path in paths
        ]

    @property
    def distances(self) -> list[float]:
        """The distance from the goal before each push, and at the end (mm)."""
        measured = [step.distance_mm for step in self.record.steps]
        return np.asarray([*measured, self.record.final_mm], float).tolist()

    def turn_at(self, frame: int) -> int:
        """Return the index of the current push; -1 before the first."""
        return int(np.searchsorted(self.starts, frame, side="right")) - 1


def episode_title(record: EpisodeRecord) -> str:
    """Return the title of an episode: its model and outcome."""
    model = style_of(record.model).label
    return f"{model}, {record.goals} goal {record.trial + 1}: {outcome(record)}"


def outcome(record: EpisodeRecord) -> str:
    """Return how an episode ended."""
    pushes = "1 push" if record.pushes == 1 else f"{record.pushes} pushes"
    if record.solved:
        return f"solved with {pushes}"
    # Leave out the details after the colon, which the record keeps.
    reason = record.reason.partition(":")[0]
    return f"{'not at the goal' if reason == 'solved' else reason} after {pushes}"


def episode_data(record: EpisodeRecord) -> dict[str, object]:
    """Return an episode as JSON values for the script of the page (mm, rad, s)."""
    frames = EpisodeFrames(record)
    return {
        "title": episode_title(record),
        "model": style_of(record.model).label,
        "goal_name": f"{record.goals} goal {record.trial + 1}",
        "pushes": record.pushes,
        "said": outcome(record),
        "solved": record.solved,
        "timeStep": 1 / FRAMES_PER_SECOND,
        "steps": len(frames.poses) - 1,
        "radius": record.radius_mm,
        "pusherRadius": record.pusher_radius_mm,
        "goal": dict(zip("xy", record.goal_mm, strict=True)),
        "tolerance": record.tolerance_mm,
        "moved": record.moved,
        "bodies": [
            plane(frames.poses[:, body])
            | {"angle": numbers(np.deg2rad(frames.poses[:, body, 2]).round(5))}
            for body in range(frames.poses.shape[1])
        ],
        "pusher": plane(frames.pusher),
        "turns": [
            {"start": start, "plan": [plane(plan[:, i]) for i in range(plan.shape[1])]}
            for start, plan in zip(frames.starts, frames.plans, strict=True)
        ],
        "distances": numbers(frames.distances),
    }


def plane(places: np.ndarray) -> dict[str, list[float | None]]:
    """Return x and y of places as JSON values."""
    return {name: numbers(places[:, axis]) for axis, name in enumerate("xy")}


def numbers(values: Iterable[float]) -> list[float | None]:
    """Return numbers, with None for NaN and infinity, which JSON lacks."""
    return [float(value) if np.isfinite(value) else None for value in values]
