"""One chunk of simulated pushes: what truth and s-bar have in common, and what not."""

from functools import lru_cache

import numpy as np
import pytest

from datasets.stores import small
from sainet.datasets.batch import to_batch, to_controls, to_initial, to_scene
from sainet.datasets.generate import simulate_chunk, store_info
from sainet.datasets.schema import variables
from sainet.scenes.controls import ForceControls, PathControls
from sainet.scenes.scene import TIME_STEP, pair_gaps, pusher_gaps

# One disk that is what the assumed engine takes it for.
AS_ASSUMED = {
    "disks": 1,
    "mass_kg": (0.896,),
    "radius_mm": (52.5,),
    "table_friction": (0.15,),
}


@lru_cache
def chunk(setup="robot", **settings):
    config = small(setup=setup, force_steps=60, chunk_size=12, pushes=12, **settings)
    return simulate_chunk(config, 0), store_info(config)


both_setups = pytest.mark.parametrize("setup", ["robot", "direct-force"])


@both_setups
def test_a_chunk_has_every_array_in_its_shape(setup):
    arrays, info = chunk(setup)
    assert arrays.keys() == variables(info).keys()
    for name, variable in variables(info).items():
        assert arrays[name].shape == variable.shape(info), name
        assert np.isfinite(arrays[name]).all(), name


@both_setups
def test_pushes_start_at_rest_and_in_contact(setup):
    arrays, info = chunk(setup)
    scene, initial = to_scene(arrays, info), to_initial(arrays)
    assert np.abs(pusher_gaps(scene, initial)[:, 0]).max() < 1e-7
    assert np.abs(pair_gaps(scene, initial)[:, 0, 1]).max() < 1e-7
    assert not np.asarray(initial.velocity).any()
    assert not np.asarray(initial.spin).any()


@both_setups
def test_truth_and_prediction_start_from_the_same_state(setup):
    arrays, _ = chunk(setup)
    for name in ("truth", "simulated_planar"):
        pose, rate = arrays[name][:, 0, :, :3], arrays[name][:, 0, :, 3:]
        before = pose - TIME_STEP * rate
        np.testing.assert_allclose(before, arrays["initial"][..., :3], atol=1e-6)


@both_setups
def test_truth_equals_the_prediction_of_the_same_engine(setup):
    arrays, _ = chunk(setup, noise_level="none", **AS_ASSUMED)
    np.testing.assert_allclose(
        arrays["truth"][..., :3], arrays["simulated_planar"][..., :3], atol=1e-6
    )
    np.testing.assert_allclose(arrays["measured"], arrays["truth"][..., :3], atol=1e-9)
    assert np.abs(arrays["truth"][:, -1, 0, :2]).max() > 1e-4, "nothing moved"


@both_setups
def test_noise_acts_only_on_the_truth(setup):
    quiet, _ = chunk(setup, noise_level="none")
    noisy, _ = chunk(setup)
    np.testing.assert_array_equal(quiet["simulated_planar"], noisy["simulated_planar"])
    assert np.abs(quiet["truth"] - noisy["truth"])[..., :3].max() > 1e-5
    captured = noisy["measured"] - noisy["truth"][..., :3]
    np.testing.assert_allclose(captured[..., :2].std(), 0.15e-3, rtol=0.1)
    np.testing.assert_allclose(captured[..., 2].std(), np.deg2rad(0.1), rtol=0.1)


def test_the_true_pusher_is_near_its_command_and_then_holds():
    arrays, _ = chunk()
    error = arrays["truth_pusher"] - arrays["command_position"]
    assert 5e-5 < np.abs(error).max() < 1.5e-3
    held = np.abs(np.diff(arrays["truth_pusher"][:, -12:], axis=1))
    assert held.max() < 1e-6


def test_the_last_chunk_is_short():
    config = small(pushes=7)
    arrays = simulate_chunk(config, 1)
    assert {len(values) for values in arrays.values()} == {2}
    whole = simulate_chunk(small(), 1)
    for name, values in arrays.items():
        np.testing.assert_array_equal(values, whole[name][:2], err_msg=name)


def test_steps_are_rounded_up_to_buckets():
    arrays, info = chunk(speed_mm_s=(20.0, 50.0))
    moving = np.abs(arrays["command_velocity"]).max(-1) > 0
    needed = moving.sum(1) + 12
    assert ((arrays["steps"] >= needed) & (arrays["steps"] < needed + 40)).all()
    assert (arrays["steps"] % 40 == 0).all()
    assert len(set(arrays["steps"])) > 1
    assert info.steps >= arrays["steps"].max()


def test_the_paper_records_200_steps():
    assert store_info(small(hold_steps=152, stroke_mm=(10.0,))).steps == 200


# Batches.


def test_batches_contain_the_stored_values():
    arrays, info = chunk()
    batch = to_batch(arrays, info, steps=30, simulated="planar")
    assert batch.size == 12
    assert batch.truth.shape == (12, 30, 2, 6)
    assert isinstance(batch.controls, PathControls)
    assert batch.controls.steps == 30
    np.testing.assert_array_equal(batch.simulated, arrays["simulated_planar"][:, :30])
    np.testing.assert_allclose(batch.measured, arrays["measured"][:, :30], atol=1e-7)
    np.testing.assert_array_equal(batch.scene.mass, arrays["mass"])
    np.testing.assert_array_equal(batch.initial.position, arrays["initial"][..., :2])
    assert np.asarray(batch.pose_observed).all()


def test_steps_beyond_a_push_are_not_observed():
    arrays, info = chunk(speed_mm_s=(20.0, 50.0))
    observed = np.asarray(to_batch(arrays, info).rate_observed)
    np.testing.assert_array_equal(observed.sum(1), arrays["steps"])
    assert not observed.all()


def test_batches_of_force_driven_pushes_have_the_pusher():
    arrays, info = chunk("direct-force")
    controls = to_controls(arrays, info)
    assert isinstance(controls, ForceControls)
    assert (controls.pusher_mass, controls.damping) == (10.0, 1000.0)
    strength = np.linalg.norm(controls.force, axis=-1)
    np.testing.assert_allclose(strength, 8.0, rtol=1e-6)
    assert to_batch(arrays, info).simulated is None
