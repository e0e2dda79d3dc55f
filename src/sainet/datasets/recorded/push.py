"""A recorded push at the model's steps: resampled, with rates that are smoothed."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from sainet.datasets.recorded.tracks import Track
from sainet.scenes.scene import TIME_STEP

LONGEST = 60.0  # s
SMOOTHING = 25  # samples of a window of the Savitzky-Golay filter: 0.1 s
_ORDER = 2  # of its polynomials
_BUCKET = 40  # steps: pushes of nearly the same length share a compilation


class Unusable(Exception):
    """A recording of which no push can be made; the message is the reason."""


@dataclass(frozen=True)
class RecordedPush:
    """What is known of a push, after each step of the model."""

    group: str
    initial: Float[np.ndarray, "body 3"]  # pose (m, m, rad) before the push
    motion: Float[np.ndarray, "time body 6"]  # packed motion, NaN where unknown
    initial_pusher: Float[np.ndarray, "2"]  # m
    pusher: Float[np.ndarray, "time 2"]  # m
    pusher_velocity: Float[np.ndarray, "time 2"]  # m/s
    name: str = ""  # what its file calls it, with the file
    plan: str = ""  # alike of pushes that were meant to be; empty where nobody says

    @property
    def steps(self) -> int:
        """How many steps were recorded."""
        return len(self.motion)

    @property
    def bodies(self) -> int:
        """The number of disks."""
        return len(self.initial)

    @property
    def held_steps(self) -> int:
        """The steps with what is added, in which the pusher rests, nothing is known."""
        return -(-self.steps // _BUCKET) * _BUCKET


def resample(bodies: Track, pusher: Track, group: str) -> RecordedPush:
    """Bring two clocks onto the one of the model, from where both have begun.

    Args:
        bodies: x, y and angle (m, m, rad; unwrapped) of one body after the other.
        pusher: x and y (m).
        group: that the push belongs to.

    Raises:
        Unusable: the clocks share too little or too much time.
    """
    start = max(bodies.time[0], pusher.time[0])
    duration = min(bodies.time[-1], pusher.time[-1]) - start
    steps = _steps(duration)
    moments = TIME_STEP * np.arange(steps + 1)
    bodies, pusher = bodies.since(start), pusher.since(start)
    known = bodies.covers(moments) & pusher.covers(moments)
    pose, path = bodies.at(moments), pusher.at(moments)
    count = pose.shape[1] // 3
    return RecordedPush(
        group=group,
        initial=pose[0].reshape(count, 3),
        motion=_motion(pose, known).reshape(steps, count, 6),
        initial_pusher=path[0],
        pusher=path[1:],
        pusher_velocity=_command_velocity(path),
    )


def _steps(duration: float) -> int:
    if duration > LONGEST:
        raise Unusable(f"lasts more than {LONGEST:.0f} s")
    steps = round(duration / TIME_STEP)
    if steps < 1:
        raise Unusable("lasts less than a step, or its clocks share no time")
    return steps


def _motion(
    pose: Float[np.ndarray, "sample column"], known: Bool[np.ndarray, " sample"]
) -> Float[np.ndarray, "time body 6"]:
    """Return packed motion after each step, NaN where it is not known."""
    place = np.where(known[1:, None], pose[1:], np.nan)
    rate = np.where(_is_smooth(known)[:, None], _smoothed_rates(pose), np.nan)
    shape = (len(place), -1, 3)
    return np.concatenate([place.reshape(shape), rate.reshape(shape)], axis=-1)


def _is_smooth(known: Bool[np.ndarray, " sample"]) -> Bool[np.ndarray, " time"]:
    """Whether all is known that the rate during a step is smoothed over."""
    if len(known) < SMOOTHING:
        return np.zeros(len(known) - 1, bool)
    whole = np.convolve(known, np.ones(SMOOTHING), "same") > SMOOTHING - 0.5
    return whole[1:] & whole[:-1]


def _smoothed_rates(
    value: Float[np.ndarray, "sample column"],
) -> Float[np.ndarray, "time column"]:
    """Return the rate during each step, as ``p(t+1) = p(t) + dt * v(t+1)`` wants it.

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
    path: Float[np.ndarray, "sample 2"],
) -> Float[np.ndarray, "time 2"]:
    """Return the smoothed velocity of the pusher; of a short push, the mean one."""
    mean = (path[-1] - path[0]) / (TIME_STEP * (len(path) - 1))
    smooth = _smoothed_rates(path)
    return np.where(np.isfinite(smooth), smooth, mean)
