"""An episode as frames that play: what the page and the video of it are made of."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from jaxtyping import Float

from sainet.report.palette import style_of

FRAMES_PER_SECOND = 30  # records hold every eighth step of 1/240 s
_FRAMES_OF_PUSH = 12  # 0.4 s: the push itself lasts 0.2 s, and then all rests
_STRIDE = 3  # of the points of a planned path

Record = Mapping[str, Any]


@dataclass(frozen=True)
class EpisodeFrames:
    """What is seen at each thirtieth of a second, the time to decide left out."""

    record: Record

    @cached_property
    def starts(self) -> list[int]:
        """The frame at which each push begins."""
        lengths = [1 + len(self._shown(turn["actual"])) for turn in self._turns]
        return [0, *np.cumsum(lengths).tolist()][: len(lengths)]

    @cached_property
    def poses(self) -> Float[np.ndarray, "frame body 3"]:
        """The pose of each disk (mm, mm, degrees)."""
        if not self._turns:
            return np.asarray([self.record["final"]], float)
        parts = [
            part
            for turn in self._turns
            for part in ([turn["observed"]], self._shown(turn["actual"]))
        ]
        return np.concatenate([np.asarray(part, float) for part in parts])

    @cached_property
    def pusher(self) -> Float[np.ndarray, "frame 2"]:
        """The centre of the pusher (mm); before the first push it is nowhere."""
        if not self._turns:
            return np.full((1, 2), np.nan)
        parts = [self._shown(turn["pusher"]) for turn in self._turns]
        # It stands at the disk, where its push begins, when the disks are observed.
        return np.concatenate([np.asarray([part[0], *part], float) for part in parts])

    @property
    def plans(self) -> list[Float[np.ndarray, "point body 2"]]:
        """The planned path of the disks' centres at each decision (mm)."""
        paths = [np.asarray(turn["planned"], float) for turn in self._turns]
        return [
            np.concatenate([path[::_STRIDE, :, :2], path[-1:, :, :2]]) for path in paths
        ]

    @property
    def distances(self) -> list[float]:
        """The distance from the goal before each push, and at the end (mm)."""
        seen = [turn["distance_mm"] for turn in self._turns]
        return np.asarray([*seen, self.record["final_mm"]], float).tolist()

    def turn_at(self, frame: int) -> int:
        """Return which push is under way; -1 when there is none."""
        return int(np.searchsorted(self.starts, frame, side="right")) - 1

    @property
    def _turns(self) -> list[dict[str, Any]]:
        return self.record["turns"]

    @staticmethod
    def _shown(path: list) -> list:
        return path[:_FRAMES_OF_PUSH]


def episode_title(record: Record) -> str:
    """Return who pushes, and how it ended."""
    model = style_of(record["model"]).label
    return f"{model}, {record['goals']} goal {record['trial'] + 1}: {outcome(record)}"


def outcome(record: Record) -> str:
    """Return how an episode ended."""
    pushes = "1 push" if record["pushes"] == 1 else f"{record['pushes']} pushes"
    if record["solved"]:
        return f"solved with {pushes}"
    # What follows a colon explains the reason: the record keeps it.
    reason = record["reason"].partition(":")[0]
    return f"{'not at the goal' if reason == 'solved' else reason} after {pushes}"


def episode_data(record: Record) -> dict[str, Any]:
    """Return an episode as JSON values for the script of the page (mm, rad, s)."""
    frames = EpisodeFrames(record)
    return {
        "title": episode_title(record),
        "said": outcome(record),
        "timeStep": 1 / FRAMES_PER_SECOND,
        "steps": len(frames.poses) - 1,
        "radius": record["radius_mm"],
        "pusherRadius": record["pusher_radius_mm"],
        "goal": dict(zip("xy", record["goal_mm"], strict=True)),
        "tolerance": record["tolerance_mm"],
        "moved": record["moved"],
        "bodies": [
            _plane(frames.poses[:, body])
            | {"angle": _numbers(np.deg2rad(frames.poses[:, body, 2]).round(5))}
            for body in range(frames.poses.shape[1])
        ],
        "pusher": _plane(frames.pusher),
        "turns": [
            {"start": start, "plan": [_plane(plan[:, i]) for i in range(plan.shape[1])]}
            for start, plan in zip(frames.starts, frames.plans, strict=True)
        ],
        "distances": _numbers(frames.distances),
    }


def _plane(places: np.ndarray) -> dict[str, list[float | None]]:
    return {name: _numbers(places[:, axis]) for axis, name in enumerate("xy")}


def _numbers(values: Iterable[float]) -> list[float | None]:
    """Return numbers; what is not finite has no place in JSON: None."""
    return [float(value) if np.isfinite(value) else None for value in values]
