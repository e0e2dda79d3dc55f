"""Scenes, states and trajectories."""

import inspect

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from contracts.worlds import make_scene, moving
from sainet.runs.errors import BadScene
from sainet.scenes.scene import Scene, check_scene, pair_gaps, pusher_gaps
from sainet.scenes.state import (
    Trajectory,
    at_rest,
    check_state,
    pack_motion,
    unpack_motion,
)

SCENE = make_scene([[1.0, 2.0, 3.0]], [[0.05, 0.06, 0.07]])
STATE = moving(
    [[[0.0, 0.0], [0.2, 0.0], [0.0, -0.1]]], np.full((1, 3, 2), 0.1), [[1.0, 2.0, 3.0]]
)


def with_value(tree, name, value):
    return eqx.tree_at(lambda t: getattr(t, name), tree, value)


def test_counts_and_batches():
    assert SCENE.body_count == STATE.body_count == 3
    assert SCENE.batch_shape == (1,)


def test_gaps_are_between_surfaces():
    gaps = np.asarray(pair_gaps(SCENE, STATE))[0]
    assert np.isinf(np.diag(gaps)).all()
    np.testing.assert_allclose(gaps, gaps.T)
    assert gaps[0, 1] == pytest.approx(0.2 - 0.11, abs=1e-7)
    assert gaps[0, 2] == pytest.approx(0.1 - 0.12, abs=1e-7)
    near = with_value(STATE, "pusher_position", jnp.array([[-0.1, 0.0]]))
    found = np.asarray(pusher_gaps(SCENE, near))[0]
    assert found[0] == pytest.approx(0.1 - 0.05 - 0.0048, abs=1e-7)
    assert found[1] == pytest.approx(0.3 - 0.06 - 0.0048, abs=1e-7)


def test_packed_motion_unpacks_to_the_same_state():
    packed = pack_motion(STATE)
    assert packed.shape == (1, 3, 6)
    np.testing.assert_allclose(packed[0, 1], [0.2, 0, 0, 0.1, 0.1, 2], rtol=1e-6)
    again = unpack_motion(packed, STATE.pusher_position, STATE.pusher_velocity)
    assert eqx.tree_equal(again, STATE)


def test_at_rest_nothing_moves():
    state = at_rest(STATE.position, STATE.angle, STATE.pusher_position)
    assert not np.asarray(state.velocity).any()
    assert not np.asarray(state.spin).any()
    assert not np.asarray(state.pusher_velocity).any()


def test_trajectories_have_a_final_state():
    packed = jnp.stack([pack_motion(STATE) * t for t in (1.0, 2.0, 3.0)], axis=1)
    path = jnp.zeros((1, 3, 2))
    trajectory = Trajectory(unpack_motion(packed, path, path))
    np.testing.assert_array_equal(trajectory.final.position, 3 * STATE.position)
    np.testing.assert_array_equal(trajectory.final.spin, 3 * STATE.spin)


@pytest.mark.parametrize("value", [np.nan, np.inf, -1.0, 0.0])
@pytest.mark.parametrize("name", ["mass", "radius", "pusher_radius"])
def test_properties_must_be_positive(name, value):
    values = getattr(SCENE, name)
    scene = with_value(SCENE, name, values.at[(0,) * values.ndim].set(value))
    with pytest.raises(BadScene, match=f"^x.csv: {name} is .*; it must be from "):
        check_scene(scene, "x.csv")


@pytest.mark.parametrize("name", ["table_friction", "disk_friction", "pusher_friction"])
def test_frictions_must_not_be_negative(name):
    check_scene(with_value(SCENE, name, jnp.zeros(1)))
    for value in (-0.1, np.nan, np.inf):
        with pytest.raises(BadScene, match=f"{name} is .* must be from 0 to 10"):
            check_scene(with_value(SCENE, name, jnp.full(1, value)))


@pytest.mark.parametrize("value", [np.nan, np.inf])
@pytest.mark.parametrize(
    "name",
    [
        *("position", "angle", "velocity", "spin"),
        *("pusher_position", "pusher_velocity"),
    ],
)
def test_states_must_be_finite(name, value):
    check_state(STATE)
    values = getattr(STATE, name)
    state = with_value(STATE, name, values.at[(0,) * values.ndim].set(value))
    with pytest.raises(BadScene, match=f"row 3: {name} holds NaN"):
        check_state(state, "row 3")


def test_a_scene_of_plain_numbers_is_checked():
    scene = Scene.disks([0.9, 1.0], [0.054, 0.059], table_friction=0.2)
    assert (scene.body_count, scene.batch_shape) == (2, ())
    assert float(scene.table_friction) == pytest.approx(0.2)
    with pytest.raises(BadScene, match=r"scene: mass is 900 \(in grams\?\)"):
        Scene.disks([900.0], [0.05])
    with pytest.raises(BadScene, match="2 masses and 1 radii"):
        Scene.disks([1.0, 1.0], [0.05])
    with pytest.raises(BadScene, match="time_step is 0; it must be from"):
        Scene.disks([1.0], [0.05], time_step=0.0)


def test_whole_numbers_become_real_ones():
    make = inspect.unwrap(at_rest)  # without the types of the tests
    state = make(np.array([[0, 0], [1, 0]]), np.zeros(2, int), jnp.zeros(2, int))
    assert {leaf.dtype for leaf in jax.tree.leaves(state)} == {jnp.dtype("float32")}


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"mass": [], "radius": []}, r"mass has the shape \[0\]"),
        ({"mass": [[1.0, 1.0]]}, r"mass has the shape \[1, 2\]"),
        (
            {"table_friction": np.array([0.1, 0.2])},
            r"table_friction is \[0.1 0.2\]; give one",
        ),
    ],
)
def test_disks_have_one_number_each_and_scenes_one_friction(given, words):
    usual = {"mass": [1.0, 1.0], "radius": [0.05, 0.05]}
    make = inspect.unwrap(Scene.disks.__func__)  # without the types of the tests
    with pytest.raises(BadScene, match=words):
        make(Scene, **{**usual, **given})
