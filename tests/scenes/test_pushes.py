"""Pushes, the grid of 72, and pushes as controls over time."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from contracts.worlds import make_scene
from sainet.scenes.pushes import (
    Push,
    PushGrid,
    command_force,
    command_path,
    place_pusher,
    push_axis,
    push_direction,
)
from sainet.scenes.scene import TIME_STEP, pusher_gaps
from sainet.scenes.state import at_rest


def push(contact=0.0, direction=0.0, length=0.01, speed=0.05) -> Push:
    values = (contact, direction, length, speed)
    return Push(*(jnp.full(1, value, jnp.float32) for value in values))


def scene_and_state(places):
    places = jnp.asarray(places, jnp.float32)[None]
    count = places.shape[1]
    scene = make_scene(np.ones((1, count)), np.full((1, count), 0.05))
    return scene, at_rest(places, jnp.zeros((1, count)), jnp.zeros((1, 2)))


def test_the_grid_has_72_pushes_at_the_midpoints_of_its_bins():
    pushes = PushGrid().pushes()
    assert pushes.contact_angle.shape == (72,)
    contact = np.rad2deg(np.asarray(pushes.contact_angle)).reshape(12, 6)
    heading = np.rad2deg(np.asarray(pushes.direction)).reshape(12, 6)
    np.testing.assert_allclose(contact[:, 0], np.arange(-55, 60, 10), atol=1e-4)
    np.testing.assert_allclose(heading[0], np.arange(-25, 30, 10), atol=1e-4)
    assert (contact == contact[:, :1]).all()
    assert (heading == heading[:1]).all()
    np.testing.assert_allclose(pushes.length, 0.01)
    np.testing.assert_allclose(pushes.speed, 0.05)


def test_the_axis_points_from_disk_1_to_disk_2():
    _, pair = scene_and_state([[0.1, 0.1], [0.1, 0.3]])
    np.testing.assert_allclose(push_axis(pair), [np.pi / 2], rtol=1e-6)
    _, alone = scene_and_state([[0.1, 0.1]])
    np.testing.assert_array_equal(push_axis(alone), [0])


@pytest.mark.parametrize("places", [[[0.3, -0.2]], [[0.3, -0.2], [0.25, -0.1]]])
def test_the_pusher_touches_the_back_of_disk_1(places):
    scene, state = scene_and_state(places)
    found = place_pusher(scene, state, push())
    placed = eqx.tree_at(lambda s: s.pusher_position, state, found)
    assert float(pusher_gaps(scene, placed)[0, 0]) == pytest.approx(0, abs=1e-7)
    axis = np.array([1.0, 0.0]) if len(places) == 1 else np.diff(places, axis=0)[0]
    behind = np.asarray(places)[0] - 0.0548 * axis / np.linalg.norm(axis)
    np.testing.assert_allclose(found[0], behind, atol=1e-6)
    apart = eqx.tree_at(
        lambda s: s.pusher_position, state, place_pusher(scene, state, push(), gap=0.01)
    )
    assert float(pusher_gaps(scene, apart)[0, 0]) == pytest.approx(0.01, abs=1e-7)


def test_angles_rotate_the_start_and_the_heading():
    scene, state = scene_and_state([[0.0, 0.0]])
    turned = push(contact=np.pi / 2, direction=-np.pi / 6)
    place = place_pusher(scene, state, turned)
    np.testing.assert_allclose(place[0], [0, -0.0548], atol=1e-7)
    heading = push_direction(state, turned)
    wanted = [np.cos(np.pi / 3), np.sin(np.pi / 3)]
    np.testing.assert_allclose(heading[0], wanted, atol=1e-6)


def test_a_path_goes_its_length_at_its_speed_and_holds():
    scene, state = scene_and_state([[0.1, 0.2]])
    along = push(direction=np.arctan2(0.8, 0.6))
    initial, controls = command_path(scene, state, along, steps=60)
    assert controls.steps == 60
    assert controls.kind == "robot"
    start = initial.pusher_position
    np.testing.assert_allclose(start, place_pusher(scene, state, along))
    way = np.asarray(controls.position[0] - start)
    np.testing.assert_allclose(way, way[:, :1] * np.array([1, 4 / 3]), atol=1e-7)
    gone = np.linalg.norm(way, axis=-1)
    np.testing.assert_allclose(gone[:48], 0.05 / 240 * np.arange(1, 49), atol=1e-7)
    np.testing.assert_allclose(gone[48:], 0.01, atol=1e-7)
    speed = np.linalg.norm(controls.velocity[0], axis=-1)
    np.testing.assert_allclose(speed[:48], 0.05, rtol=1e-3)
    assert speed[49:].max() == 0


@pytest.mark.parametrize(
    ("length", "speed"), [(0.01, 0.03), (0.0101, 0.05), (0.05, 0.01)]
)
def test_a_path_is_the_sum_of_its_velocities(length, speed):
    steps = int(length / speed * 240) + 5
    scene, state = scene_and_state([[0.0548, 0.0]])
    initial, controls = command_path(
        scene, state, push(length=length, speed=speed), steps=steps
    )
    path = np.cumsum(np.asarray(controls.velocity, np.float64), axis=1) * TIME_STEP
    path += np.asarray(initial.pusher_position)[:, None]
    np.testing.assert_allclose(controls.position, path, atol=1e-6)
    assert float(controls.position[0, -1, 0]) == pytest.approx(length, abs=1e-7)
    assert np.asarray(controls.velocity).max() <= speed * 1.001


def test_forces_are_constant_along_the_heading():
    scene, state = scene_and_state([[0.1, 0.0]])
    along = push(direction=np.arctan2(0.8, 0.6))
    initial, controls = command_force(scene, state, along, force=8.0, steps=5)
    assert controls.steps == 5
    assert controls.kind == "direct-force"
    np.testing.assert_allclose(controls.force, [[[4.8, 6.4]] * 5], rtol=1e-6)
    np.testing.assert_allclose(controls.contact_offset, [[-0.0548, 0.0]], atol=1e-7)
    np.testing.assert_allclose(initial.pusher_position, [[0.0452, 0.0]], atol=1e-7)


def test_a_batch_equals_a_map_over_scenes():
    scene, state = scene_and_state([[0.3, -0.2], [0.25, -0.1]])
    one = jax.tree.map(lambda x: x[0], (scene, state))
    pushes = PushGrid().pushes()
    mapped = jax.vmap(lambda p: place_pusher(*one, p))(pushes)
    repeated = jax.tree.map(lambda x: jnp.repeat(x, 72, axis=0), (scene, state))
    np.testing.assert_allclose(mapped, place_pusher(*repeated, pushes), atol=1e-7)
