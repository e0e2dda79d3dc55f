"""Resampling: two clocks, what is known, and rates that noise does not drown."""

import numpy as np
import pytest

from sainet.datasets.recorded.checks import recording_problems
from sainet.datasets.recorded.properties import Properties
from sainet.datasets.recorded.raw import without_symmetry_jumps
from sainet.datasets.recorded.resample import (
    SMOOTHING,
    ResampledPush,
    Track,
    resample,
    tracks_of,
)
from sainet.scenes.recording import Recording

DISKS = Properties(
    bodies=("near", "far"), mass=(1.0, 1.0), radius=(0.05, 0.04), pusher_radius=0.005
)


def clock(duration: float = 1.0, start: float = 0.0) -> np.ndarray:
    return start + np.arange(round(250 * duration) + 1) / 250


def still(time: np.ndarray) -> Track:
    return Track(time, np.zeros((len(time), 2)))


def along(time: np.ndarray, x: np.ndarray) -> Track:
    zero = np.zeros_like(time)
    return Track(time, np.column_stack([x, zero, zero]))


def merged(disk: Track, tip: Track) -> Recording:
    """One recording of two clocks: NaN where one of them has no sample."""
    time = np.union1d(disk.time, tip.time)
    pose, pusher = np.full((len(time), 3), np.nan), np.full((len(time), 2), np.nan)
    pose[np.searchsorted(time, disk.time)] = disk.value
    pusher[np.searchsorted(time, tip.time)] = tip.value
    return Recording(time=time, pose=pose[:, None], pusher=pusher)


def resampled(disk: Track, tip: Track) -> ResampledPush:
    return resample(merged(disk, tip))


def test_the_samples_of_each_clock_come_back_from_one_recording():
    rng = np.random.default_rng(0)
    disk = Track(clock(0.2), rng.normal(size=(51, 3)))
    tip = Track(clock(0.3, start=0.0011), rng.normal(size=(76, 2)))
    for found, wanted in zip(tracks_of(merged(disk, tip)), (disk, tip), strict=True):
        np.testing.assert_array_equal(found.time, wanted.time)
        np.testing.assert_array_equal(found.value, wanted.value)


def test_of_two_samples_without_what_is_between_only_the_ends_are_known():
    """Also when the push is shorter than the longest gap in other recordings."""
    for duration in (0.05, 1.0):
        time = np.array([0.0, duration])
        pose = np.array([[[0.1, 0.0, 0.0]], [[0.2, 0.0, 0.5]]])
        pusher = np.array([[0.0, 0.0], [0.1, 0.0]])
        found = Recording(time=time, pose=pose, pusher=pusher)
        push = resample(found, longest_gap=0.0)
        known = np.isfinite(push.motion[:, 0, 0])
        assert np.flatnonzero(known).tolist() == [push.steps - 1]
        np.testing.assert_array_equal(push.initial, pose[0])
        np.testing.assert_array_equal(push.motion[-1, :, :3], pose[1])
        speed = push.pusher_velocity
        np.testing.assert_array_equal(speed, np.broadcast_to(speed[0], speed.shape))
        np.testing.assert_allclose(
            push.pusher[:, 0], np.linspace(0, 0.1, push.steps + 1)[1:]
        )


def test_rates_satisfy_the_convention_of_the_engines():
    """Of a parabola p(t+1) = p(t) + dt v(t+1) holds to what interpolation leaves."""
    time = np.arange(241) / 240
    push = resampled(along(time, 0.1 * time**2), still(time))
    place = np.concatenate([push.initial[None], push.motion[..., :3]])[:, 0, 0]
    rate = push.motion[:, 0, 3]
    known = np.isfinite(rate)
    assert known.sum() == 240 - (SMOOTHING - 1)
    np.testing.assert_allclose(rate[known], (240 * np.diff(place))[known], atol=1e-9)


def test_noise_of_the_poses_does_not_drown_the_rates():
    time = clock(4.0)
    noise = 1e-4 * np.random.default_rng(0).standard_normal(len(time))
    push = resampled(along(time, 0.05 * time + noise), still(time))
    error = push.motion[:, 0, 3] - 0.05
    error = error[np.isfinite(error)]
    raw = 240 * np.diff(push.motion[:, 0, 0]) - 0.05
    assert error.std() < 1e-3  # m/s
    assert raw.std() > 10 * error.std()


def test_gaps_are_neither_interpolated_nor_differentiated():
    time = clock()
    kept = (time <= 0.4) | (time >= 0.6)
    push = resampled(along(time[kept], time[kept]), still(time))
    known = np.isfinite(push.motion[:, 0, 0])
    after = np.arange(1, 241) / 240
    beside = 1 / 240 + 1e-9
    gap = (after > 0.4 + beside) & (after < 0.6 - beside)
    np.testing.assert_array_equal(known, ~gap)
    rates = np.isfinite(push.motion[:, 0, 3])
    assert not (rates & (after > 0.4 - 0.04) & (after < 0.6 + 0.04)).any()
    assert rates.sum() == 240 - (SMOOTHING - 1) - gap.sum() - (SMOOTHING - 1) - 1


def test_a_pose_without_an_angle_is_not_known():
    time = clock(0.5)
    recording = merged(along(time, 0.1 * time), still(time))
    recording.pose[30:90, 0, 2] = np.nan
    poses = resample(recording).motion[..., :3]
    assert np.isfinite(poses[-1]).all()
    assert np.isnan(poses[40]).all()


def test_between_samples_at_the_longest_gap_poses_are_known_despite_rounding():
    time = np.arange(21) / 10
    assert np.isfinite(resampled(along(time, time), still(time)).motion[..., :3]).all()


def test_steps_after_the_recording_are_unknown():
    time = np.append(clock(0.5), 0.5018)  # 120.43 steps
    assert resampled(along(time, time), still(time)).steps == 120
    time = np.append(clock(0.5), 0.503)  # 120.72 steps
    push = resampled(along(time, time), still(time))
    assert push.steps == 121
    assert np.isfinite(push.motion[:, 0, 0]).sum() == 120
    assert push.pusher_velocity.shape == (121, 2)


def test_the_push_starts_where_both_clocks_have_begun():
    disk, tip = clock(1.0, start=1e9), clock(1.0, start=1e9 + 0.1234)
    push = resampled(along(disk, disk - 1e9), still(tip))
    assert push.initial[0, 0] == pytest.approx(0.1234, abs=1e-6)
    assert push.steps == round((1 - 0.1234) * 240)


def good(duration: float = 1.0, speed: float = 0.05) -> Recording:
    """A pusher and two disks in a row that move together."""
    time = clock(duration)
    x = speed * time
    pose = np.zeros((len(time), 2, 3))
    pose[:, 0, 0], pose[:, 1, 0] = x, x + 0.09
    pose[:, 0, 2] = 6 * x
    return Recording(time=time, pose=pose, pusher=np.column_stack([x - 0.055, 0 * x]))


def with_pose(rows, body: int, column: int, change: float) -> Recording:
    found = good()
    found.pose[rows, body, column] += change
    return found


def with_pusher(rows, change: float) -> Recording:
    found = good()
    found.pusher[rows, 1] += change
    return found


def shifted_clock(late: float, duration: float = 1.0) -> Recording:
    disk, tip = clock(duration), clock(duration, start=late)
    return merged(along(disk, 0 * disk), still(tip))


def without_samples() -> Recording:
    found = good()
    found.pose[1:, 1] = np.nan
    return found


ALL = slice(None)
IMPLAUSIBLE = {
    "fewer than two samples": without_samples(),
    "lasts less than a step, or its clocks share no time": shifted_clock(2.0),
    "lasts over 60 s": good(60.1, 1e-3),
    "the place is out of range": with_pose(ALL, 1, 0, 60.0),
    "the angle is out of range": with_pose(ALL, 1, 2, 57.3),
    "an angle changes too much": with_pose(ALL, 1, 2, 10 * clock()),
    "the body jumps": with_pose(slice(99, None), 0, 1, 0.006),
    "the pusher jumps": with_pusher(slice(99, None), 0.006),
    "the angle jumps": with_pose(slice(99, None), 0, 2, 0.2),
    "an overlap at the start": with_pose(ALL, 1, 0, -0.006),
    "a disk moves too far": with_pose(ALL, 1, 0, 0.3 * clock()),
    "a disk moves untouched": with_pusher(ALL, 1.0),
}


@pytest.mark.parametrize("kind", IMPLAUSIBLE)
def test_what_no_push_does_is_found(kind):
    recording = IMPLAUSIBLE[kind]
    properties = DISKS
    if recording.bodies == 1:
        properties = Properties(
            bodies=("one",), mass=(1.0,), radius=(0.05,), pusher_radius=0.005
        )
    assert next(recording_problems(recording, properties)).kind == kind


def test_what_pushes_do_is_no_problem():
    slides = good(1.0, 1.0)
    slides.pose[:, 1, 0] += 0.2 * clock()  # on ahead of the pusher
    rolls = with_pose(ALL, 1, 2, 2.0 * clock())
    passes = with_pusher(ALL, 1.0)
    passes.pose[:] = passes.pose[:1]  # a disk that nothing touches rests
    for recording in (good(), good(59.9, 1e-3), slides, rolls, passes):
        assert list(recording_problems(recording, DISKS)) == []


def test_a_problem_names_the_sample_and_the_body():
    jump = next(recording_problems(with_pose(slice(99, None), 1, 1, 0.01), DISKS))
    assert (jump.sample, jump.body) == (99, 1)


def test_marker_symmetries_are_corrected():
    true = np.linspace(3.0, 3.4, 50)
    seen = true + np.repeat([0, np.pi / 2, -np.pi, 2 * np.pi, -np.pi / 2], 10)
    np.testing.assert_allclose(without_symmetry_jumps(seen), true, atol=1e-12)
    seen = true + np.repeat([0, 0.5], 25)
    np.testing.assert_allclose(without_symmetry_jumps(seen), seen, atol=1e-12)
