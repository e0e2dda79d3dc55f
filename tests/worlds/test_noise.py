"""Noise of the simulated world has the stated sizes and correlations."""

from dataclasses import replace

import jax.numpy as jnp
import numpy as np
import pytest

from sainet.scenes.scene import TIME_STEP, FrictionField
from sainet.worlds.noise import (
    NoiseConfig,
    at_level,
    capture_error,
    force_error,
    friction_features,
    ornstein_uhlenbeck,
    tracking_error,
)

NOISE = NoiseConfig()


def generator():
    return np.random.default_rng(12)


def test_walk_has_its_deviation_and_correlation_time():
    noise = NoiseConfig(correlation_time=0.1)
    walk = ornstein_uhlenbeck(generator(), (4000, 240, 2), 0.3, noise, TIME_STEP)
    late = walk[:, 200]
    assert late.std() == pytest.approx(0.3, rel=0.03)
    assert late.mean() == pytest.approx(0, abs=0.015)
    for lag in (6, 24):
        found = np.mean(late * walk[:, 200 - lag]) / np.mean(late**2)
        assert found == pytest.approx(np.exp(-lag * TIME_STEP / 0.1), abs=0.05)
    axes = np.corrcoef(late[:, 0], late[:, 1])[0, 1]
    assert axes == pytest.approx(0, abs=0.05)
    first = 0.3 * np.sqrt(1 - np.exp(-2 * TIME_STEP / 0.1))
    assert walk[:, 0].std() == pytest.approx(first, rel=0.03)


def test_tracking_error_holds_still_while_the_pusher_holds():
    moving = np.arange(60)[None] < np.full((500, 1), 40)
    error = tracking_error(generator(), moving, NOISE, TIME_STEP)
    np.testing.assert_array_equal(error[:, 40:], np.repeat(error[:, 39:40], 20, axis=1))
    assert (np.diff(error[:, :40], axis=1) != 0).all()
    assert error[:, 39].std() == pytest.approx(0.2e-3, rel=0.1)


def test_force_error_is_a_fraction_of_the_force():
    force = np.zeros((2000, 240, 2))
    force[:, :, 0] = 8.0
    error = force_error(generator(), force, NOISE, TIME_STEP)
    assert error[:, -1].std() == pytest.approx(0.8, rel=0.05)


def test_friction_field_is_gaussian_about_one():
    features = friction_features(generator(), 4000, NOISE)
    field = FrictionField(
        **{k: jnp.asarray(v, jnp.float32) for k, v in features.items()}
    )

    def at(distance):
        return np.asarray(
            field.at(jnp.full(4000, 0.1 + distance), jnp.full(4000, -0.2))
        )

    here = at(0.0)
    assert here.mean() == pytest.approx(1, abs=0.01)
    assert here.std() == pytest.approx(0.15, rel=0.05)
    assert np.mean(np.abs(here - 1) < 0.15) == pytest.approx(0.683, abs=0.03)
    for distance in (0.01, 0.03, 0.06):
        wanted = np.exp(-(distance**2) / (2 * 0.03**2))
        assert np.corrcoef(here, at(distance))[0, 1] == pytest.approx(wanted, abs=0.05)


def test_friction_field_never_falls_below_a_tenth():
    field = FrictionField(
        wave=jnp.zeros((1, 2)), phase=jnp.full(1, jnp.pi), amplitude=jnp.asarray(5.0)
    )
    assert float(field.at(jnp.asarray(0.0), jnp.asarray(0.0))) == pytest.approx(0.1)


def test_capture_error_has_its_sizes_and_is_white():
    error = capture_error(generator(), (100, 200, 2), NOISE)
    np.testing.assert_allclose(error[..., :2].std((0, 1, 2)), 0.15e-3, rtol=0.03)
    assert error[..., 2].std() == pytest.approx(np.deg2rad(0.1), rel=0.03)
    after = np.corrcoef(error[:, 1:].ravel(), error[:, :-1].ravel())[0, 1]
    assert after == pytest.approx(0, abs=0.02)


SIZES = (
    "tracking_mm",
    "force_fraction",
    "friction_fraction",
    "capture_mm",
    "capture_deg",
)


@pytest.mark.parametrize(
    ("level", "factor"), [("none", 0), ("default", 1), ("paper-like", 3)]
)
def test_levels_scale_every_size_and_no_length(level, factor):
    scaled = at_level(NOISE, level)
    for size in SIZES:
        assert getattr(scaled, size) == pytest.approx(factor * getattr(NOISE, size))
    assert replace(scaled, **{size: getattr(NOISE, size) for size in SIZES}) == NOISE


def test_no_noise_is_zero():
    none = at_level(NOISE, "none")
    moving = np.ones((3, 20), bool)
    assert not tracking_error(generator(), moving, none, TIME_STEP).any()
    assert not force_error(generator(), np.ones((3, 20, 2)), none, TIME_STEP).any()
    assert not capture_error(generator(), (3, 20, 2), none).any()
    assert not friction_features(generator(), 3, none)["amplitude"].any()
