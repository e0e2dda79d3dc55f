"""Recordings resampled at the model's steps, with smoothed velocities."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from sainet.scenes.recording import Conditions, Recording
from sainet.scenes.scene import TIME_STEP

LONGEST_GAP = 0.1  # s: between samples further apart the pose is unknown
SMOOTHING = 25  # samples of a window of the Savitzky-Golay filter: 0.1 s
_ORDER = 2  # of its polynomials
_BUCKET = 40  # steps: pushes of nearly equal length share a compilation
_SAME_TIME = 1e-6  # s: clocks that count from 1970 are no finer than this


@dataclass(frozen=True)
class Track:
    """Samples of one quantity at increasing times."""

    time: Float[np.ndarray, " sample"]  # s
    value: Float[np.ndarray, "sample column"]

    def at(self, time: Float[np.ndarray, " moment"]) -> Float[np.ndarray, "moment _"]:
        """Return the values at some times, linearly interpolated.

        Before the first sample and after the last one the values are constant.
        """
        columns = [np.interp(time, self.time, column) for column in self.value.T]
        return np.column_stack(columns)

    def covers(
        self, time: Float[np.ndarray, " moment"], longest_gap: float = LONGEST_GAP
    ) -> Bool[np.ndarray, " moment"]:
        """Return whether the values at some times are known.

        Values are known between samples at most `longest_gap` (s) apart and, unless
        that is shorter, within a step of any sample.
        """
        after = np.clip(np.searchsorted(self.time, time), 1, len(self.time) - 1)
        before = after - 1
        early, late = time - self.time[before], self.time[after] - time
        within = (early >= -_SAME_TIME) & (late >= -_SAME_TIME)
        near = min(TIME_STEP, longest_gap) + _SAME_TIME
        beside = np.minimum(np.abs(early), np.abs(late)) <= near
        return within & (beside | (early + late <= longest_gap + _SAME_TIME))

    def since(self, start: float) -> "Track":
        """Return the same samples on a clock that is zero at a given time (s)."""
        return Track(self.time - start, self.value)


def body_track(recording: Recording, body: int) -> Track:
    """Return the samples at which the pose of a disk (m, m, rad) is known."""
    return _known(recording.time, recording.pose[:, body])


def pusher_track(recording: Recording) -> Track:
    """Return the samples at which the place of the pusher (m) is known."""
    return _known(recording.time, recording.pusher)


def _known(
    time: Float[np.ndarray, " sample"], value: Float[np.ndarray, "sample column"]
) -> Track:
    known = np.asarray(np.isfinite(value).all(axis=-1))
    return Track(time[known], value[known])


def tracks_of(recording: Recording) -> list[Track]:
    """Return the samples of all disks, then those of the pusher."""
    bodies = [body_track(recording, body) for body in range(recording.bodies)]
    return [*bodies, pusher_track(recording)]


def common_span(tracks: list[Track]) -> tuple[float, float]:
    """Return when all tracks have begun and for how long all of them last (s)."""
    start = max(track.time[0] for track in tracks)
    return start, min(track.time[-1] for track in tracks) - start


@dataclass(frozen=True)
class ResampledPush:
    """A recorded push after each step of the model."""

    initial: Float[np.ndarray, "body 3"]  # pose (m, m, rad) before the push
    motion: Float[np.ndarray, "time body 6"]  # packed motion, NaN where unknown
    initial_pusher: Float[np.ndarray, "2"]  # m
    pusher: Float[np.ndarray, "time 2"]  # m
    pusher_velocity: Float[np.ndarray, "time 2"]  # m/s
    conditions: Conditions
    source: str  # names the push in messages
    plan: str  # equal for repetitions of one push; empty: unknown

    @property
    def steps(self) -> int:
        """The number of recorded steps."""
        return len(self.motion)

    @property
    def bodies(self) -> int:
        """The number of disks."""
        return len(self.initial)

    @property
    def held_steps(self) -> int:
        """The steps rounded up to whole buckets, in which the pusher holds still."""
        return -(-self.steps // _BUCKET) * _BUCKET


def resample(
    recording: Recording, *, longest_gap: float = LONGEST_GAP
) -> ResampledPush:
    """Resample a recording at the model's steps from when all clocks have begun.

    Args:
        recording: passed `checks.recording_problems`.
        longest_gap: longest time between samples (s) with known poses in between.
    """
    tracks = tracks_of(recording)
    start, duration = common_span(tracks)
    steps = round(duration / TIME_STEP)
    moments = TIME_STEP * np.arange(steps + 1)
    *bodies, pusher = (track.since(start) for track in tracks)
    known = np.all([t.covers(moments, longest_gap) for t in (*bodies, pusher)], axis=0)
    pose = np.concatenate([body.at(moments) for body in bodies], axis=1)
    path = pusher.at(moments)
    return ResampledPush(
        initial=pose[0].reshape(-1, 3),
        motion=_motion(pose, known).reshape(steps, -1, 6),
        initial_pusher=path[0],
        pusher=path[1:],
        pusher_velocity=_command_velocity(path, is_straight=len(pusher.time) == 2),  # noqa: PLR2004
        conditions=recording.conditions,
        source=recording.source,
        plan=recording.plan,
    )


def _motion(
    pose: Float[np.ndarray, "sample column"], known: Bool[np.ndarray, " sample"]
) -> Float[np.ndarray, "time body 6"]:
    """Return packed motion after each step, NaN where it is unknown."""
    place = np.where(known[1:, None], pose[1:], np.nan)
    rate = np.where(_is_smooth(known)[:, None], _smoothed_rates(pose), np.nan)
    shape = (len(place), -1, 3)
    return np.concatenate([place.reshape(shape), rate.reshape(shape)], axis=-1)


def _is_smooth(known: Bool[np.ndarray, " sample"]) -> Bool[np.ndarray, " time"]:
    """Return whether all samples in the smoothing window of each step are known."""
    if len(known) < SMOOTHING:
        return np.zeros(len(known) - 1, bool)
    whole = np.convolve(known, np.ones(SMOOTHING), "same") > SMOOTHING - 0.5
    return whole[1:] & whole[:-1]


def _smoothed_rates(
    value: Float[np.ndarray, "sample column"],
) -> Float[np.ndarray, "time column"]:
    """Return the rate during each step, consistent with p(t+1) = p(t) + dt v(t+1).

    It is the mean of the Savitzky-Golay derivatives at both ends of the step, which is
    exact for a parabola; NaN if there are too few samples to smooth.
    """
    from scipy.signal import savgol_filter

    if len(value) < SMOOTHING:
        return np.full((len(value) - 1, value.shape[1]), np.nan)
    rate = np.asarray(
        savgol_filter(value, SMOOTHING, _ORDER, deriv=1, delta=TIME_STEP, axis=0)
    )
    return (rate[1:] + rate[:-1]) / 2


def _command_velocity(
    path: Float[np.ndarray, "sample 2"], *, is_straight: bool
) -> Float[np.ndarray, "time 2"]:
    """Return the smoothed velocity of the pusher.

    Of a push too short for the filter, and of one whose pusher is known at its two ends
    only, it is the mean velocity.
    """
    mean = (path[-1] - path[0]) / (TIME_STEP * (len(path) - 1))
    if is_straight:
        return np.broadcast_to(mean, path[1:].shape)
    smooth = _smoothed_rates(path)
    return np.where(np.isfinite(smooth), smooth, mean)
