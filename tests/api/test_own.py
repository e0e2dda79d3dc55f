"""Engines and models of a user's own stand beside those of the package."""

from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from msgspec import structs

import sainet as sn
from contracts.worlds import make_scene
from models.samples import identified_folder
from sainet.api.learning import _internal
from sainet.datasets.batch import from_trajectory, to_controls, to_initial, to_scene
from sainet.datasets.store import open_store
from sainet.datasets.writer import write_store
from sainet.engines.simulator import OWN, BulletSpec, InternalEngine
from sainet.models.card import IDENTIFIED, read_identified
from sainet.models.dynamics import predict
from sainet.runs.documents import write_document
from sainet.runs.errors import BadCheckpoint, BadInput, RunConflict, UnknownName
from sainet.scenes.pushes import command_force, command_path
from sainet.tasks.push_to_goal import PushToGoal

SCENE = sn.Scene.disks(mass=[0.9, 1.0], radius=[0.054, 0.059])
PUSHES = sn.Push(contact_angle=jnp.array([-0.3, 0.0, 0.4]))


def slipping(xp):
    """A step function on arrays of JAX or NumPy: disk 1 follows the pusher, slipping.

    The more friction between the two, the less it slips.
    """

    def step(scene, state):
        first = (xp.arange(state.angle.shape[-1]) == 0)[:, None]
        kept = xp.minimum(4 * scene.pusher_friction, 1)[:, None]
        velocity = xp.where(first, (kept * state.pusher_velocity)[:, None], 0.0)
        moved = state.position + scene.time_step * velocity
        return eqx.tree_at(lambda s: (s.position, s.velocity), state, (moved, velocity))

    return step


@pytest.fixture
def own() -> sn.Model:
    return sn.from_step(slipping(jnp), name="slipping")


@pytest.fixture
def on_host() -> sn.Model:
    return sn.from_step(slipping(np), name="slipping-host", numpy=True)


def final(model: sn.Model) -> np.ndarray:
    found = model.predict(SCENE, SCENE.in_a_row(), PUSHES, steps=60)
    return np.asarray(found.final.position)


def test_step_functions_in_jax_and_numpy_agree(own, on_host):
    pushed = final(own)
    np.testing.assert_allclose(pushed, final(on_host), atol=1e-6)
    way = pushed[:, 0] - np.asarray(SCENE.in_a_row().position[0])
    # With the friction of 0.25 nothing slips: disk 1 moves as far as the pusher.
    np.testing.assert_allclose(np.linalg.norm(way, axis=-1), 0.01, atol=1e-6)


@pytest.mark.parametrize("numpy", [False, True])
def test_two_rollouts_of_a_step_function_equal_one(numpy):
    model = sn.from_step(slipping(np if numpy else jnp), name="x", numpy=numpy)
    dynamics = model.dynamics
    scene = jax.tree.map(lambda x: x[None], SCENE)
    rest = jax.tree.map(lambda x: x[None], SCENE.in_a_row())
    initial, controls = command_path(scene, rest, sn.Push(jnp.ones(1)), steps=60)
    parts = [
        jax.tree.map(lambda x, p=p: x[:, p], controls)
        for p in (slice(25), slice(25, None))
    ]
    carry, one = dynamics.advance(scene, dynamics.begin(scene, initial), parts[0])
    _, two = dynamics.advance(scene, carry, parts[1])
    whole = predict(dynamics, scene, initial, controls)
    joined = jnp.concatenate([one.states.position, two.states.position], axis=1)
    np.testing.assert_allclose(joined, whole.states.position, atol=1e-7)
    np.testing.assert_allclose(
        whole.states.pusher_position, controls.position, atol=1e-7
    )


def test_a_step_of_another_shape_is_refused():
    wrong = sn.from_step(lambda scene, state: (1, 2), name="wrong")
    with pytest.raises(BadInput, match="returns a tuple; it must be a State"):
        final(wrong)

    def narrow(scene, state):
        return eqx.tree_at(lambda s: s.angle, state, state.angle[:, :1])

    with pytest.raises(BadInput, match=r"angle of the shape \[3, 1\].* be \[3, 2\]"):
        final(sn.from_step(narrow, name="narrow"))
    with pytest.raises(BadInput, match="name"):
        sn.from_step(narrow, name="../x")


def test_an_own_engine_refuses_forces(own):
    scene = make_scene(np.ones((1, 2)), np.full((1, 2), 0.05))
    rest = jax.tree.map(lambda x: x[None], SCENE.in_a_row())
    push = command_force(scene, rest, sn.Push(jnp.zeros(1)), force=8.0, steps=9)
    with pytest.raises(BadInput, match="take pushers that follow a path"):
        predict(own.dynamics, scene, *push)


def test_a_network_is_trained_around_an_own_engine(own, pushes, tmp_path):
    out = tmp_path / "network"
    network = sn.tune("sain", pushes, engine=own, iterations=3, out=out)
    assert network.internal == own.internal
    assert network.name == "network"
    # The network starts as its engine: three iterations move it little.
    np.testing.assert_allclose(final(network), final(own), atol=2e-4)
    again = sn.load(out)
    np.testing.assert_array_equal(final(again), final(network))
    del OWN["slipping"]
    with pytest.raises(UnknownName, match="call `from_step` with name='slipping'"):
        sn.load(out)


def test_the_engine_that_is_given_is_used_whatever_was_made_since(own, pushes):
    name = own.name
    sn.from_step(lambda scene, state: state, name=name)  # nothing moves
    network = sn.tune("sain", pushes, engine=own, iterations=1)
    np.testing.assert_allclose(final(network), final(own), atol=2e-4)


def test_a_network_around_another_engine_is_no_start(own, pushes):
    with pytest.raises(BadCheckpoint, match="give `start` another network"):
        sn.tune("sain", pushes, engine=own, start="sain")


@pytest.fixture
def slipped(pushes, tmp_path) -> sn.Pushes:
    """The pushes of the dataset, as disks move that slip."""
    arrays, info = pushes.store.read(slice(None)), pushes.store.info
    scene = eqx.tree_at(
        lambda s: s.pusher_friction, to_scene(arrays, info), jnp.full(12, 0.17)
    )
    engine = sn.from_step(slipping(jnp), name="truth").dynamics
    found = predict(engine, scene, to_initial(arrays), to_controls(arrays, info))
    motion = from_trajectory(found)[0]
    arrays |= {"truth": motion, "measured": motion[..., :3]}
    (tmp_path / "slipped").mkdir()
    write_store(tmp_path / "slipped", info, arrays)
    return sn.Pushes(open_store(tmp_path / "slipped"))


def test_frictions_of_an_own_engine_are_identified(own, slipped):
    found = sn.identify(slipped, engine=own)
    assert found.identified is not None
    estimates = {each.name: each for each in found.identified.estimates}
    assert "pressure_radius_ratio" not in estimates
    friction = estimates.pop("pusher_friction")
    assert friction.doubt is None
    assert friction.value == pytest.approx(0.17, rel=1e-3)
    # The step depends on nothing else.
    assert all(each.doubt for each in estimates.values())
    assert found.identified.after_mm < 0.01 < found.identified.before_mm


def test_frictions_of_a_step_in_numpy_are_identified(on_host, own, slipped):
    """By finite differences, which agree with the derivatives of JAX."""
    by_name = {}
    for engine in (own, on_host):
        found = sn.identify(slipped, engine=engine).identified
        assert found is not None
        by_name[engine.name] = {each.name: each for each in found.estimates}
    exact, near = (each["pusher_friction"] for each in by_name.values())
    assert near.doubt is None
    assert near.value == pytest.approx(exact.value, rel=1e-4)
    assert (near.low, near.high) == pytest.approx((exact.low, exact.high), rel=1e-3)


def test_an_engine_without_derivatives_is_not_identified(slipped):
    """Bullet, which is not built."""
    bullet = InternalEngine(BulletSpec())
    physics = replace(sn.load("physics"), internal=bullet)
    with pytest.raises(BadInput, match="`engine` is bullet, which has no derivatives"):
        sn.identify(slipped, engine=physics)


def test_an_identified_engine_brings_its_pushes_into_training(tmp_path):
    identified_folder(tmp_path)
    found = structs.replace(read_identified(tmp_path), digests="AAAAAAAA")
    write_document(tmp_path / IDENTIFIED, found)
    assert _internal(sn.load(tmp_path)).pushes == "AAAAAAAA"


def test_errors_of_a_step_in_numpy_stay_as_they_are():
    wrong = sn.from_step(lambda scene, state: (1, 2), name="wrong", numpy=True)
    with pytest.raises(BadInput, match="returns a tuple; it must be a State"):
        final(wrong)


def carry(scene, initial, controls):
    """Poses of disks, of which disk 1 moves as the pusher does."""
    moved = controls.position - initial.pusher_position[:, None]
    poses = np.zeros((*moved.shape[:2], initial.angle.shape[-1], 3))
    poses[..., :2] = initial.position[:, None]
    poses[..., 2] = initial.angle[:, None]
    poses[:, :, 0, :2] += moved
    return poses


def test_a_function_predicts_like_the_same_engine(own):
    carried = sn.from_function(carry, name="carried")
    np.testing.assert_allclose(final(carried), final(own), atol=1e-6)
    states = carried.predict(SCENE, SCENE.in_a_row(), PUSHES).states
    step = np.diff(np.asarray(states.position), axis=1) * 240  # m/s
    np.testing.assert_allclose(states.velocity[:, 1:], step, atol=1e-4)


def test_a_function_may_be_advanced_in_parts():
    carried = sn.from_function(carry, name="carried").dynamics
    scene = jax.tree.map(lambda x: x[None], SCENE)
    rest = jax.tree.map(lambda x: x[None], SCENE.in_a_row())
    initial, controls = command_path(scene, rest, sn.Push(jnp.ones(1)), steps=60)
    begun, found = carried.begin(scene, initial), []
    for part in (slice(20), slice(20, 45), slice(45, None)):
        some = jax.tree.map(lambda x, p=part: x[:, p], controls)
        begun, trajectory = carried.advance(scene, begun, some)
        found.append(trajectory.states.position)
    whole = predict(carried, scene, initial, controls).states.position
    np.testing.assert_array_equal(jnp.concatenate(found, axis=1), whole)


def test_a_function_that_returns_another_shape_is_refused():
    flat = sn.from_function(lambda s, i, c: np.zeros((3, 60, 6)), name="flat")
    with pytest.raises(BadInput, match=r"\[3, 60, 6\]; it must be \[3, 60, 2, 3\]"):
        final(flat)


def test_the_message_about_a_shape_names_the_pushes_of_the_dataset(pushes):
    flat = sn.from_function(lambda s, i, c: np.zeros((3, 2)), name="flat")
    steps = pushes.store.info.steps
    with pytest.raises(BadInput, match=rf"\[3, 2\]; it must be \[12, {steps}, 2, 3\]"):
        sn.evaluate([flat], pushes)


def shove(scene, initial, controls):
    """As `carry`, and disk 1 moves disk 2 out of its way."""
    poses = carry(scene, initial, controls)
    between = poses[:, :, 1, :2] - poses[:, :, 0, :2]
    distance = np.linalg.norm(between, axis=-1, keepdims=True)
    overlap = np.maximum(scene.radius.sum(axis=-1)[:, None, None] - distance, 0)
    poses[:, :, 1, :2] += overlap * between / distance
    return poses


def test_a_function_controls_beside_ours(tmp_path):
    """Episodes towards the same goals, with models of a user's own and by name."""
    config = sn.ControlConfig(model="physics", pushes=3, trials=2, noise_level="none")
    shoved = sn.from_function(shove, name="shoved")
    own = sn.run_trials(config, tmp_path / "own", model=shoved)
    assert [each.model for each in own] == ["shoved", "shoved"]
    ours = sn.run_trials(config, str(tmp_path / "ours"))
    again = sn.run_trials(config, model="physics")  # in a temporary folder
    assert [each.model for each in again] == ["physics", "physics"]
    for one, other, same in zip(own, ours, again, strict=True):
        assert one.goal_mm == other.goal_mm
        assert one.final_mm < one.steps[0].distance_mm - 5  # 3 pushes of 10 mm
        assert other.final == same.final
    resumed = sn.run_trials(config, tmp_path / "own", model=shoved)
    assert resumed[0].decision_s == own[0].decision_s
    with pytest.raises(RunConflict):
        sn.run_trials(config, tmp_path / "own", model="sain")


def test_a_network_that_a_user_trained_controls(pushes):
    """One in memory, whose folder is gone."""
    config = sn.ControlConfig(pushes=1, trials=1)
    network = sn.tune("sain", pushes, iterations=1).called("mine")
    (found,) = sn.run_trials(config, model=network)
    assert found.model == "mine"


def test_predictions_in_a_file_refuse_to_control(pushes, tmp_path):
    steps = pushes.store.info.steps
    np.savez(tmp_path / "own.npz", pose=np.zeros((12, steps, 2, 3)))
    model = sn.from_predictions(tmp_path / "own.npz", pushes)
    with pytest.raises(BadInput, match="can neither predict others nor plan"):
        sn.run_trials(sn.ControlConfig(pushes=1, trials=1), model=model)


@pytest.mark.parametrize("kind", ["own", "on_host", "function"])
def test_own_engines_and_functions_plan(kind, own, on_host):
    models = {"own": own, "on_host": on_host}
    model = models.get(kind) or sn.from_function(carry, name="carried")
    grid = sn.PushGrid(contact_bins=3, direction_bins=2)
    planner = sn.make_planner("greedy")
    planner = eqx.tree_at(lambda p: p.actions, planner, grid)
    # Disk 1 is the target: what is ahead of it is reached by pushes from behind.
    task = PushToGoal(jnp.array([0.03, 0.0]), moved=0)
    plan = planner.plan(model.dynamics, task, SCENE, SCENE.in_a_row())
    assert plan.distance < 0.03 - 0.015  # m; two pushes of 10 mm
