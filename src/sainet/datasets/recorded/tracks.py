"""Samples on a clock of their own: what is wrong with them, and what lies between."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from sainet.scenes.scene import TIME_STEP

LONGEST_GAP = 0.1  # s: what lies between samples further apart is not known
ALLOWED_MOVE = 0.005  # m, between samples of 250 Hz: 1.25 m/s
ALLOWED_TURN = np.deg2rad(10)  # rad, between samples of 250 Hz: 44 rad/s
_SPACING = 1 / 250  # s
_QUARTER = np.pi / 2  # rad
_SAME_TIME = 1e-6  # s: clocks that count from 1970 are no finer than this


@dataclass(frozen=True)
class Track:
    """What one clock recorded; the times rise."""

    time: Float[np.ndarray, " sample"]  # s
    value: Float[np.ndarray, "sample column"]

    def at(self, time: Float[np.ndarray, " moment"]) -> Float[np.ndarray, "moment _"]:
        """Return the values at some times, on the straight line between samples.

        Before the first sample and after the last one they hold.
        """
        columns = [np.interp(time, self.time, column) for column in self.value.T]
        return np.column_stack(columns)

    def covers(self, time: Float[np.ndarray, " moment"]) -> Bool[np.ndarray, " moment"]:
        """Whether the values at some times are known, and not made up in a long gap."""
        after = np.clip(np.searchsorted(self.time, time), 1, len(self.time) - 1)
        before = after - 1
        early, late = time - self.time[before], self.time[after] - time
        within = (early >= -_SAME_TIME) & (late >= -_SAME_TIME)
        beside = np.minimum(np.abs(early), np.abs(late)) <= TIME_STEP + _SAME_TIME
        return within & (beside | (early + late <= LONGEST_GAP))

    def since(self, start: float) -> "Track":
        """Return the same samples by a clock that is zero at a time (s)."""
        return Track(self.time - start, self.value)


def without_repeats(track: Track) -> Track:
    """Drop samples whose stamp is that of the sample before."""
    new = np.diff(track.time, prepend=-np.inf) != 0
    return Track(track.time[new], track.value[new])


def first_fall(time: Float[np.ndarray, " sample"]) -> int | None:
    """Return the first sample that is not later than the one before it, if any."""
    return _first(np.diff(time) <= 0)


def first_jump(
    time: Float[np.ndarray, " sample"],
    moved: Float[np.ndarray, " step"],
    allowed: float,
) -> int | None:
    """Return the first sample that lies too far from the one before it, if any.

    Args:
        time: of the samples (s), rising.
        moved: how far each sample but the first lies from the one before.
        allowed: between samples of 250 Hz; samples further apart may move more.
    """
    more = np.maximum(np.diff(time) / _SPACING, 1)
    return _first(moved > allowed * more)


def distances(place: Float[np.ndarray, "sample 2"]) -> Float[np.ndarray, " step"]:
    """Return how far (m) each sample but the first lies from the one before."""
    return np.linalg.norm(np.diff(place, axis=0), axis=1)


def without_symmetry_jumps(
    yaw: Float[np.ndarray, " sample"],
) -> Float[np.ndarray, " sample"]:
    """Undo jumps of about a quarter or half a turn between neighbours; unwrap (rad).

    Markers in a square look the same from four sides, and a tracker may change its
    mind. What is left of a jump stays, be it as large as an eighth of a turn.
    """
    turned = np.diff(yaw)
    left = turned - _QUARTER * np.rint(turned / _QUARTER)
    return yaw[0] + np.concatenate([[0.0], np.cumsum(left)])


def _first(wrong: Bool[np.ndarray, " step"]) -> int | None:
    found: Int[np.ndarray, " wrong"] = np.flatnonzero(wrong)
    return int(found[0]) + 1 if len(found) else None
