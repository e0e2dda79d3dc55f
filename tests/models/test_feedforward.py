"""Feedforward networks: one number of disks, a naive reference, round trips."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from learning.stores import info_of, made_up, quiet_store, write
from models.samples import Glide, pushes
from sainet.evaluation.evaluate import evaluate
from sainet.learning.fit import fit
from sainet.learning.recipes import PAPER, RESIDUAL, FromModel
from sainet.models.checkpoint import load_network
from sainet.models.correctors.feedforward import FeedforwardNetwork, whole_state
from sainet.models.correctors.network import FEATURE_BOUND
from sainet.models.dynamics import LearnedDynamics, SimulatorAugmented, predict
from sainet.models.inputs import Moment, drives, in_columns, push_frame
from sainet.models.library import load_model
from sainet.models.model import Model
from sainet.planning import make_planner
from sainet.runs.errors import BadCheckpoint, BadStore
from sainet.scenes.pushes import Push
from sainet.scenes.scene import TIME_STEP, Scene
from sainet.scenes.state import pack_motion
from sainet.tasks.push_to_goal import PushToGoal

RECIPE = PAPER.changed(
    features="whole-state",
    iterations=100,
    batch_size=24,
    learning_rate=3e-3,
    log_every=5,
)


def network(*, simulator=False, disks=2, kind="robot"):
    features = whole_state(kind, simulator=simulator, disks=disks)
    key = jax.random.key(disks)
    return FeedforwardNetwork(features, time_step=TIME_STEP, key=key)


def dynamics(*, simulator, disks=2, kind="robot"):
    made = network(simulator=simulator, disks=disks, kind=kind)
    return SimulatorAugmented(made, Glide()) if simulator else LearnedDynamics(made)


@pytest.fixture(scope="module")
def trained(tmp_path_factory):
    """Folder, log and pushes of a network that learned a few quiet pushes."""
    folder = tmp_path_factory.mktemp("feedforward")
    store = quiet_store(folder)
    return folder / "in", fit("in", store, RECIPE, folder / "in").history, store


def naive(made, moment):
    """The accelerations of one push, number by number."""
    motion, still, drive = moment
    inputs = [motion[0:2], motion[3:6], drive.simulated_pose_step]
    inputs += [drive.simulated_rate_step, None, still.mass[None], still.radius[None]]
    offset = np.asarray(drive.pusher)[:, 0] - np.asarray(motion)[0:2, 0, 0]
    gap = np.linalg.norm(offset) - still.radius[0, 0] - still.pusher_radius[0]
    action = [*np.asarray(drive.action)[:, 0], *offset, gap]
    numbers = []
    for part in inputs:
        if part is None:
            numbers += [x for value in action for x in (value, 0.0)]
        else:
            numbers += list(np.asarray(part)[:, :, 0].ravel())
    x = FEATURE_BOUND * np.tanh(np.array(numbers) / FEATURE_BOUND)
    layers = list(zip(made.layers.weights, made.layers.biases, strict=True))
    for weight, bias in layers:
        x = np.asarray(weight).T @ x + np.asarray(bias)
        x = x if weight is layers[-1][0] else np.maximum(x, 0)
    return x.reshape(3, -1)


def test_the_accelerations_are_those_of_a_naive_network():
    made = network(simulator=True)
    scene, initial, controls = pushes("robot", 2)
    frame, packed = push_frame(scene, initial), pack_motion(initial)
    path = pack_motion(Glide().rollout(scene, initial, controls).states)
    drive = jax.tree.map(lambda x: x[:1, 3], drives(controls, packed, path))
    still = jax.tree.map(lambda x: x[:1], made.features.still(scene, frame))
    moment = Moment(*in_columns((packed[:1], still, drive)))
    found = made.acceleration(moment)
    assert found.shape == (3, 2, 1)
    np.testing.assert_allclose(found[..., 0], naive(made, moment), rtol=2e-4, atol=1e-6)


@pytest.mark.parametrize(
    ("kind", "simulator", "disks"),
    [("robot", False, 2), ("robot", True, 3), ("direct-force", True, 2)],
)
def test_only_the_number_of_disks_that_it_was_made_for(kind, simulator, disks):
    model = dynamics(simulator=simulator, disks=disks, kind=kind)
    found = predict(model, *pushes(kind, disks))
    assert jnp.all(jnp.isfinite(found.states.position))
    says = f"takes {disks} disk.s., not {5 - disks}; use a network for any number"
    with pytest.raises(BadCheckpoint, match=says):
        predict(model, *pushes(kind, 5 - disks))


def test_planners_and_models_refuse_other_scenes_at_once(trained):
    folder, _, _ = trained
    model = load_model(str(folder))
    assert isinstance(model, Model)
    scene = Scene.disks([1.0] * 3, [0.05] * 3)
    with pytest.raises(BadCheckpoint, match="takes 2 disk.s., not 3"):
        model.predict(scene, scene.in_a_row(), Push(0.1, 0.0))
    task = PushToGoal(goal=jnp.array([0.3, 0.0]), tolerance=0.01)
    with pytest.raises(BadCheckpoint, match="takes 2 disk.s., not 3"):
        make_planner("greedy").plan(model.dynamics, task, scene, scene.in_a_row())


def test_it_learns_a_few_pushes_and_is_read_back(trained):
    folder, history, store = trained
    assert history[-1].loss < 0.4 * history[0].loss
    loaded, card = load_network(folder)
    assert isinstance(loaded, FeedforwardNetwork)
    assert loaded.features == whole_state("robot", simulator=False, disks=2)
    assert (card.disks, card.identity.slug) == (2, "in-whole-state")
    assert card.identity.label == "Feedforward"
    found = evaluate([load_model(str(folder))], store, force=True)
    assert np.isfinite(found.data["pos_mm"]).all()


def test_other_datasets_are_refused_before_training(trained, tmp_path):
    folder, _, store = trained
    info = info_of(4, bodies=3)
    three = write(tmp_path / "three", info, made_up(info))
    with pytest.raises(BadStore, match="of 3 disks, not 2; a network on the whole"):
        fit("in", (store, three), RECIPE, tmp_path / "both")
    again = RECIPE.changed(start=FromModel(str(folder)))
    with pytest.raises(BadCheckpoint, match=r"card.json: takes 2 disk\(s\), not"):
        fit("in", three, again, tmp_path / "again")
    with pytest.raises(BadCheckpoint, match="takes 2 disk.s., not 3"):
        evaluate([load_model(str(folder))], three)
    assert not (tmp_path / "both").exists() and not (tmp_path / "again").exists()


def test_an_additive_network_begins_as_its_engine_and_learns(tmp_path):
    info = info_of(6)
    store = write(tmp_path / "pushes", info, made_up(info))
    recipe = RESIDUAL.changed(features="whole-state", batch_size=6, iterations=4)
    history = fit("sain", store, recipe, tmp_path / "out").history
    assert np.isfinite([line.loss for line in history]).all()
    loaded = load_network(tmp_path / "out")[0]
    assert isinstance(loaded, FeedforwardNetwork)
    assert loaded.features.has_simulator
