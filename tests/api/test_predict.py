"""Models predict pushes that are given as plain numbers, single or in batches."""

from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import sainet as sn
from sainet.runs.errors import BadCheckpoint, BadInput, BadScene
from sainet.scenes.pushes import command_path
from sainet.scenes.scene import pair_gaps

SCENE = sn.Scene.disks(mass=[0.9, 1.0], radius=[0.054, 0.059])
ANGLES = jnp.array([-0.3, 0.0, 0.4])


@pytest.fixture(scope="module", params=["physics", "in", "sain"])
def model(request) -> sn.Model:
    return sn.load(request.param)


def test_numbers_become_single_precision_scalars():
    push = sn.Push(0.2, speed=np.float64(0.1))
    for value, wanted in zip(jax.tree.leaves(push), (0.2, 0.0, 0.01, 0.1), strict=True):
        assert value.shape == ()
        assert value.dtype == jnp.float32
        assert value == np.float32(wanted)


def test_numbers_are_broadcast_against_arrays():
    push = sn.Push(contact_angle=ANGLES)
    assert {x.shape for x in jax.tree.leaves(push)} == {(3,)}
    assert sn.Push(1, 0, np.arange(2), 1).length.dtype == jnp.float32


@pytest.mark.parametrize("radius", [[0.05], [0.054, 0.059], [0.05, 0.06, 0.04]])
def test_disks_in_a_row_touch_their_neighbours(radius):
    scene = sn.Scene.disks([1.0] * len(radius), radius)
    gaps = np.asarray(pair_gaps(scene, scene.in_a_row()))
    np.testing.assert_allclose(np.diagonal(gaps, 1), 0, atol=1e-7)
    assert (gaps > -1e-7).all()


def test_scenes_of_a_batch_have_the_rows_of_their_own():
    radius = jnp.array([[0.05, 0.06], [0.04, 0.05]])
    alone = [sn.Scene.disks([1, 1], row.tolist()) for row in radius]
    scenes = jax.tree.map(lambda *x: jnp.stack(x), *alone)
    for found in (scenes.in_a_row(), jax.vmap(lambda s: s.in_a_row())(scenes)):
        for index, each in enumerate(alone):
            wanted = each.in_a_row()
            np.testing.assert_array_equal(found.position[index], wanted.position)
            np.testing.assert_array_equal(
                found.pusher_position[index], wanted.pusher_position
            )


def test_vmap_over_masses_and_radii_makes_a_batch_of_scenes():
    mass, radius = jnp.array([[0.9, 1.0], [1.1, 0.8]]), jnp.array([0.05, 0.06])
    make = lambda mass: sn.Scene.disks(mass, radius, table_friction=0.2)  # noqa: E731
    scenes = jax.vmap(make)(mass)
    for index, row in enumerate(mass):
        single = jax.tree.map(lambda x, n=index: x[n], scenes)
        assert eqx.tree_equal(single, make(row))
    turned = jax.vmap(lambda r: sn.Scene.disks(1.0, r))(jnp.array([[0.05], [0.06]]))
    assert turned.radius.shape == (2, 1)


def test_gradients_reach_the_properties_of_a_scene():
    physics = sn.load("physics-true")

    def turned(radius):
        scene, push = sn.Scene.disks(1.0, radius), sn.Push(0.0, direction=0.5)
        found = physics.predict(scene, scene.in_a_row(), push, steps=100)
        return found.final.angle[0]

    slope = float(jax.grad(turned)(0.05))
    wanted = float(turned(0.0505) - turned(0.0495)) / 0.001
    assert slope == pytest.approx(wanted, rel=0.01)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: sn.Scene.disks("a", 0.05), "scene: mass is a; give numbers."),
        (lambda: sn.Scene.disks([1, None], 0.05), "scene: mass is [1, None]; give"),
        (lambda: sn.Push(np.array("left")), "push: contact_angle is left; give"),
        (lambda: sn.Push(0, speed=np.array(["x"])), "push: speed is ['x']; give"),
        (lambda: sn.PushToGoal("ab"), "task: goal is ab; give numbers."),
        (lambda: sn.at_rest("ab", 0, 0), "state: position is ab; give numbers."),
    ],
)
def test_arguments_that_are_not_numbers_are_named(make, words):
    with pytest.raises(BadScene) as error:
        make()
    assert words in str(error.value)


def test_a_goal_is_a_list_or_an_array_of_finite_numbers():
    planner, model = sn.make_planner("greedy"), sn.load("physics-true")
    task = sn.PushToGoal([0.2, 0.05])
    assert eqx.tree_equal(task, sn.PushToGoal(jnp.array([0.2, 0.05])))
    assert planner.plan(model, task, SCENE, SCENE.in_a_row()).pushes
    bad = sn.PushToGoal([np.nan, 0.05])
    with pytest.raises(BadScene, match="task: goal is nan; it must be from -100"):
        planner.plan(model, bad, SCENE, SCENE.in_a_row())


def test_vmap_over_pushes_equals_a_loop_and_a_batch(model):
    state = SCENE.in_a_row()

    def final(angle):
        push = sn.Push(contact_angle=angle)
        return model.predict(SCENE, state, push, steps=60).final.position

    mapped = jax.vmap(final)(ANGLES)
    assert mapped.shape == (3, 2, 2)
    pushes = sn.Push(contact_angle=ANGLES)
    batch = model.predict(SCENE, state, pushes, steps=60).final.position
    for index, angle in enumerate(ANGLES):
        alone = final(float(angle))
        np.testing.assert_allclose(mapped[index], alone, atol=2e-6)
        np.testing.assert_allclose(batch[index], alone, atol=2e-6)
    # Turned contacts move the disks to other places.
    assert np.ptp(np.asarray(batch)[:, 0, 1]) > 1e-3


def test_programs_of_double_precision_make_the_same_prediction(model):
    state, push = SCENE.in_a_row(), sn.Push(np.array([0.2, -0.1]), 0.1)
    usual = model.predict(SCENE, state, push, steps=60).final.position
    with jax.enable_x64(True):
        for kind in (jnp.float32, jnp.float64):
            seen = jax.tree.map(lambda x, kind=kind: x.astype(kind), state)
            push = sn.Push(np.array([0.2, -0.1]), 0.1)
            found = model.predict(SCENE, seen, push, steps=60).final.position
            assert np.allclose(found, usual, atol=1e-5)


def test_vmap_over_whole_pushes_takes_200_steps():
    physics, pushes = sn.load("physics"), sn.Push(contact_angle=ANGLES)
    found = jax.vmap(lambda p: physics.predict(SCENE, SCENE.in_a_row(), p))(pushes)
    assert found.states.angle.shape == (3, 200, 2)


def test_derivatives_pass_through_a_prediction():
    physics = sn.load("physics-true")

    def sideways(angle):
        push = sn.Push(contact_angle=angle)
        found = physics.predict(SCENE, SCENE.in_a_row(), push, steps=40)
        return found.final.position[0, 1]

    slope, step = float(jax.grad(sideways)(jnp.float32(0.2))), 0.02
    difference = float(sideways(0.2 + step) - sideways(0.2 - step)) / (2 * step)
    assert slope == pytest.approx(difference, rel=0.05)
    assert abs(slope) > 1e-3  # m/rad


@pytest.mark.parametrize("name", ["in", "sain-any"])
def test_derivatives_of_networks_are_exact_in_any_unit(name):
    """Training bounds gradients; predictions do not, and have both modes."""
    network, state, angle = sn.load(name), SCENE.in_a_row(), jnp.float32(0.2)

    def sideways(angle, unit=1.0):
        found = network.predict(SCENE, state, sn.Push(angle), steps=60)
        return unit * found.final.position[0, 1]

    slope, step = float(jax.grad(sideways)(angle)), 0.01
    large = float(jax.grad(sideways)(angle, 1e4))
    assert large == pytest.approx(1e4 * slope, rel=1e-3)
    forward = float(jax.jvp(sideways, [angle], [jnp.float32(1)])[1])
    assert forward == pytest.approx(slope, rel=1e-3)
    difference = float(sideways(angle + step) - sideways(angle - step)) / (2 * step)
    assert slope == pytest.approx(difference, rel=0.05)


def test_controls_predict_as_the_push_that_they_are_of(model):
    push = sn.Push(contact_angle=0.2)
    initial, controls = command_path(SCENE, SCENE.in_a_row(), push, steps=60)
    one = model.predict(SCENE, initial, controls).final.position
    other = model.predict(SCENE, SCENE.in_a_row(), push, steps=60).final.position
    np.testing.assert_allclose(one, other, atol=1e-6)


@pytest.mark.parametrize("shared", ["scene", "scene and state", "controls"])
def test_controls_have_the_leading_axes_of_all_parts(model, shared):
    rows = lambda part: jax.tree.map(lambda x: jnp.stack([x] * 3), part)  # noqa: E731
    scene, state, push = rows(SCENE), rows(SCENE.in_a_row()), sn.Push(ANGLES)
    if shared == "controls":
        push = sn.Push(jnp.full(3, 0.2))
    initial, controls = command_path(scene, state, push, steps=40)
    wanted = model.predict(scene, initial, controls)
    one = lambda part: jax.tree.map(lambda x: x[0], part)  # noqa: E731
    given = {
        "scene": (SCENE, initial, controls),
        "scene and state": (SCENE, one(initial), controls),
        "controls": (scene, initial, one(controls)),
    }[shared]
    if shared == "scene and state":  # the pusher of the first push
        wanted = model.predict(scene, rows(one(initial)), controls)
    found = model.predict(*given)
    for x, y in zip(jax.tree.leaves(found), jax.tree.leaves(wanted), strict=True):
        np.testing.assert_allclose(x, y, atol=1e-6)


@pytest.mark.parametrize(
    "push",
    [
        *(sn.Push(np.pi), sn.Push(0, direction=-np.pi / 2), sn.Push(0, length=1e-4)),
        sn.Push(0, length=1e-4, speed=1e-4),
    ],
)
def test_single_precision_numbers_at_a_bound_are_in_the_range(push):
    moved = sn.load("physics").predict(SCENE, SCENE.in_a_row(), push, steps=2)
    assert jnp.isfinite(moved.final.position).all()


def test_a_slow_or_long_push_is_predicted_until_its_end():
    physics = sn.load("physics-true")
    slow = sn.Push(contact_angle=0.0, speed=0.025)
    found = physics.predict(SCENE, SCENE.in_a_row(), slow)
    assert found.states.angle.shape[0] >= 96 + 152  # 0.4 s at 1/240 s, then rest
    end = found.final
    way = end.pusher_position[0] - (-0.054 - 0.0048)
    assert way == pytest.approx(0.01, abs=1e-6)
    assert jnp.abs(end.velocity).max() < 1e-6


@pytest.mark.parametrize(
    ("push", "words"),
    [
        (sn.Push(contact_angle=20), "contact_angle is 20 (in degrees?)"),
        (sn.Push(contact_angle=0, length=10), "length is 10 (in millimetres?)"),
        (sn.Push(contact_angle=0, speed=50), "speed is 50 (in mm/s?)"),
        (sn.Push(contact_angle=0, direction=np.nan), "direction is nan"),
        (sn.Push(contact_angle=0, speed=0), "speed is 0"),
    ],
)
def test_an_impossible_push_is_refused(push, words):
    with pytest.raises(BadScene) as error:
        sn.load("physics").predict(SCENE, SCENE.in_a_row(), push)
    assert words in str(error.value)


def test_parts_that_do_not_fit_are_refused():
    physics = sn.load("physics")
    three = sn.Scene.disks([1, 1, 1], [0.05, 0.05, 0.05])
    with pytest.raises(BadScene, match="it has 3 disks, the scene 2"):
        physics.predict(SCENE, three.in_a_row(), sn.Push(0.0))
    two = jax.tree.map(lambda x: jnp.stack([x, x]), SCENE.in_a_row())
    with pytest.raises(BadScene, match=r"leading axes .* are \(\), \(2,\), \(3,\)"):
        physics.predict(SCENE, two, sn.Push(ANGLES))


@pytest.mark.parametrize("value", [np.nan, np.inf])
@pytest.mark.parametrize("field", ["position", "angle", "pusher_position"])
def test_a_state_that_is_not_finite_is_refused(field, value):
    physics, state = sn.load("physics"), SCENE.in_a_row()
    at = lambda s: getattr(s, field)  # noqa: E731
    bad = eqx.tree_at(at, state, at(state).at[0].set(value))
    with pytest.raises(BadScene, match=f"^state: {field} holds NaN or infinity"):
        physics.predict(SCENE, bad, sn.Push(0.0))


def test_no_pushes_have_an_empty_prediction(model):
    none = sn.Push(contact_angle=np.zeros(0))
    for steps in (None, 5):
        found = model.predict(SCENE, SCENE.in_a_row(), none, steps=steps)
        assert found.states.position.shape == (0, steps or 200, 2, 2)
        assert found.final.pusher_position.shape == (0, 2)


def test_a_second_leading_axis_is_refused(model):
    pushes = sn.Push(contact_angle=np.zeros((2, 3)))
    with pytest.raises(BadScene, match=r"are \(\), \(\), \(2, 3\); give one axis"):
        model.predict(SCENE, SCENE.in_a_row(), pushes)


@pytest.mark.parametrize("steps", [0, -1])
def test_a_number_of_steps_that_cannot_be_predicted_is_refused(steps):
    physics, state = sn.load("physics"), SCENE.in_a_row()
    with pytest.raises(BadInput, match=f"`steps` is {steps}; it must be at least 1"):
        physics.predict(SCENE, state, sn.Push(0.0), steps=steps)


@pytest.mark.parametrize("name", ["physics", "in-stroke"])
def test_models_without_a_range_of_directions_do_not_warn(name):
    """Warnings are errors here. One disk looks alike from everywhere."""
    alone = sn.Scene.disks(mass=0.9, radius=0.054)
    sn.load(name).predict(alone, alone.in_a_row(), sn.Push(3.0), steps=2)


def test_networks_refuse_another_time_step():
    fine = sn.Scene.disks(mass=[0.9, 1.0], radius=[0.054, 0.059], time_step=1 / 480)
    with pytest.raises(BadCheckpoint, match="give the scene the same time step"):
        sn.load("in").predict(fine, fine.in_a_row(), sn.Push(0.0))
    found = sn.load("physics").predict(fine, fine.in_a_row(), sn.Push(0.0))
    assert found.states.angle.shape[0] == 400


def test_a_model_outside_jax_refuses_to_be_traced():
    def rest(scene, initial, controls):
        return np.zeros((*controls.position.shape[:2], 2, 3))

    own = sn.from_function(rest, name="rest")
    with pytest.raises(BadInput, match="rest does not run in JAX"):
        jax.vmap(lambda a: own.predict(SCENE, SCENE.in_a_row(), sn.Push(a)))(ANGLES)


@pytest.mark.parametrize(
    ("mass", "radius", "disks"),
    [(0.9, 0.054, 1), (0.9, [0.054, 0.06], 2), ([0.9, 1.0, 1], np.float32(0.05), 3)],
)
def test_one_number_is_that_of_all_disks(mass, radius, disks):
    scene = sn.Scene.disks(mass=mass, radius=radius)
    assert scene.mass.shape == scene.radius.shape == (disks,)
    np.testing.assert_allclose(scene.mass, np.broadcast_to(mass, disks), rtol=1e-6)
    np.testing.assert_allclose(scene.radius, np.broadcast_to(radius, disks), rtol=1e-6)
    assert scene.in_a_row().position.shape == (disks, 2)


def test_a_state_is_made_of_lists():
    lists = [[0, 0], [0.12, 0]], [0, 1], [-0.06, 0]
    state = sn.at_rest(*lists)
    wanted = sn.at_rest(*(jnp.asarray(each, jnp.float32) for each in lists))
    for found, same in zip(
        jax.tree.leaves(state), jax.tree.leaves(wanted), strict=True
    ):
        assert found.dtype == jnp.float32
        np.testing.assert_array_equal(found, same)
    moved = sn.load("physics").predict(SCENE, state, sn.Push(0.0), steps=20).final
    assert moved.position[0, 0] > 0.001


@pytest.mark.parametrize("name", ["physics", "sain"])
def test_controls_without_steps_are_refused(name):
    state = SCENE.in_a_row()
    none = sn.PathControls(jnp.zeros((0, 2)), jnp.zeros((0, 2)))
    with pytest.raises(BadScene, match="push: the controls have no steps; give at"):
        sn.load(name).predict(SCENE, state, none)


def test_lists_and_numbers_replace_properties():
    changed = replace(SCENE, mass=[1, 2], table_friction=0.2)
    wanted = sn.Scene.disks([1, 2], SCENE.radius, table_friction=0.2)
    assert eqx.tree_equal(changed, wanted)
    physics, state = sn.load("physics-true"), SCENE.in_a_row()
    found = physics.predict(changed, state, sn.Push([0.1, 0.2]))
    assert eqx.tree_equal(found, physics.predict(wanted, state, sn.Push([0.1, 0.2])))


def test_controls_are_lists():
    physics, state = sn.load("physics-true"), SCENE.in_a_row()
    path = sn.PathControls([[0, 0]] * 4, [[0, 0]] * 4)
    assert physics.predict(SCENE, state, path).states.position.shape == (4, 2, 2)


def test_arrays_that_change_later_change_nothing():
    numbers = np.zeros(64, np.float32)
    start = -numbers.ctypes.data // 4 % 16  # JAX shares memory that is aligned so
    mass, position = numbers[start : start + 2], np.array([[0.0, 0.0], [0.113, 0.0]])
    mass[:] = 0.9, 1.0
    scene = sn.Scene.disks(mass, [0.054, 0.059])
    state = sn.at_rest(position, np.zeros(2), np.zeros(2))
    mass[0], position[0] = 50.0, 7.0
    assert scene.mass[0] < 1
    assert not np.any(state.position[0])
