"""Resampling: two clocks, what is known, and rates that noise does not drown."""

import numpy as np
import pytest

from sainet.datasets.recorded.push import SMOOTHING, Unusable, resample
from sainet.datasets.recorded.tracks import Track, without_symmetry_jumps


def clock(duration: float = 1.0, start: float = 0.0) -> np.ndarray:
    return start + np.arange(round(250 * duration) + 1) / 250


def still(time: np.ndarray) -> Track:
    return Track(time, np.zeros((len(time), 2)))


def along(time: np.ndarray, x: np.ndarray) -> Track:
    zero = np.zeros_like(time)
    return Track(time, np.column_stack([x, zero, zero]))


def test_rates_satisfy_the_convention_of_the_engines():
    """Of a parabola p(t+1) = p(t) + dt v(t+1) holds to what interpolation leaves."""
    time = np.arange(241) / 240
    push = resample(along(time, 0.1 * time**2), still(time), "")
    place = np.concatenate([push.initial[None], push.motion[..., :3]])[:, 0, 0]
    rate = push.motion[:, 0, 3]
    known = np.isfinite(rate)
    assert known.sum() == 240 - (SMOOTHING - 1)
    np.testing.assert_allclose(rate[known], (240 * np.diff(place))[known], atol=1e-9)


def test_noise_of_the_poses_does_not_drown_the_rates():
    time = clock(4.0)
    noise = 1e-4 * np.random.default_rng(0).standard_normal(len(time))
    push = resample(along(time, 0.05 * time + noise), still(time), "")
    error = push.motion[:, 0, 3] - 0.05
    error = error[np.isfinite(error)]
    raw = 240 * np.diff(push.motion[:, 0, 0]) - 0.05
    assert error.std() < 1e-3  # m/s
    assert raw.std() > 10 * error.std()


def test_a_gap_is_not_made_up_and_rates_keep_clear_of_it():
    time = clock()
    kept = (time <= 0.4) | (time >= 0.6)
    push = resample(along(time[kept], time[kept]), still(time), "")
    known = np.isfinite(push.motion[:, 0, 0])
    after = np.arange(1, 241) / 240
    beside = 1 / 240 + 1e-9
    gap = (after > 0.4 + beside) & (after < 0.6 - beside)
    np.testing.assert_array_equal(known, ~gap)
    rates = np.isfinite(push.motion[:, 0, 3])
    assert not (rates & (after > 0.4 - 0.04) & (after < 0.6 + 0.04)).any()
    assert rates.sum() == 240 - (SMOOTHING - 1) - gap.sum() - (SMOOTHING - 1) - 1


def test_a_step_that_ends_after_the_recording_is_not_known():
    time = np.append(clock(0.5), 0.5018)  # 120.43 steps
    assert resample(along(time, time), still(time), "").steps == 120
    time = np.append(clock(0.5), 0.503)  # 120.72 steps
    push = resample(along(time, time), still(time), "")
    assert push.steps == 121
    assert np.isfinite(push.motion[:, 0, 0]).sum() == 120
    assert push.pusher_velocity.shape == (121, 2)


def test_the_clocks_start_where_both_have_begun():
    disk, tip = clock(1.0, start=1e9), clock(1.0, start=1e9 + 0.1234)
    push = resample(along(disk, disk - 1e9), still(tip), "")
    assert push.initial[0, 0] == pytest.approx(0.1234, abs=1e-6)
    assert push.steps == round((1 - 0.1234) * 240)


@pytest.mark.parametrize(("late", "duration"), [(2.0, 1.0), (0.0, 60.1)])
def test_clocks_that_share_too_little_or_too_much_are_refused(late, duration):
    disk, tip = clock(duration), clock(duration, start=late)
    with pytest.raises(Unusable, match="lasts"):
        resample(along(disk, 0 * disk), still(tip), "")


def test_only_what_is_no_symmetry_of_the_marker_stays():
    true = np.linspace(3.0, 3.4, 50)
    seen = true + np.repeat([0, np.pi / 2, -np.pi, 2 * np.pi, -np.pi / 2], 10)
    np.testing.assert_allclose(without_symmetry_jumps(seen), true, atol=1e-12)
    seen = true + np.repeat([0, 0.5], 25)
    np.testing.assert_allclose(without_symmetry_jumps(seen), seen, atol=1e-12)
