"""The non-recurrent form: cut into single steps, trained, and started again."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from contracts.worlds import engine
from learning.stores import info_of, made_up, quiet_store, write
from models.samples import Glide, network, pushes
from sainet.datasets.batch import to_batch
from sainet.datasets.config import GenerateConfig
from sainet.datasets.generate import generate
from sainet.learning.batches import predict_batch, to_single_steps
from sainet.learning.checks import check_task
from sainet.learning.fit import fit
from sainet.learning.mixture import Mixture
from sainet.learning.recipes import PAPER, SingleSteps
from sainet.learning.task import Task
from sainet.models.card import read_card
from sainet.models.dynamics import (
    LearnedDynamics,
    PhysicsDynamics,
    SimulatorAugmented,
    predict,
)
from sainet.models.inputs import motion_to_frame, push_frame
from sainet.models.library import find_internal_engine, load_model
from sainet.models.wrappers import Restarted
from sainet.runs.errors import BadCheckpoint, BadInput, BadStore
from sainet.scenes.state import pack_motion

PLANAR = find_internal_engine("planar")
CONFIG = PAPER.changed(
    iterations=60,
    batch_size=8,
    log_every=5,
    learning_rate=3e-3,
    horizon=SingleSteps(),
)


@pytest.fixture(scope="module")
def store(tmp_path_factory):
    return quiet_store(tmp_path_factory.getbasetemp())


@pytest.fixture(scope="module")
def quiet(store):
    """Pushes whose truth is exactly the prediction of the planar engine."""
    return to_batch(store.read(slice(0, 6)), store.info)


@pytest.fixture(scope="module")
def trained(store, tmp_path_factory):
    return fit("sain", store, CONFIG, tmp_path_factory.mktemp("single") / "out")


def test_a_restarted_true_engine_stays_on_the_truth(quiet):
    steps = to_single_steps(quiet, engine("planar"))
    assert steps.size == quiet.size * quiet.truth.shape[1]
    assert steps.truth.shape[1] == 1
    np.testing.assert_allclose(steps.simulated, steps.truth, atol=3e-5)
    moved = np.asarray(steps.truth[:, 0] - pack_motion(steps.initial))
    assert np.abs(moved[..., :2]).max() > 1e-4


def test_a_step_ends_where_the_next_one_begins(quiet):
    """Its target is the true pose, whatever the camera measured."""
    seen = np.random.default_rng(0).random((2, *quiet.pose_observed.shape)) < 0.5
    known = dict(zip(("pose_observed", "rate_observed"), jnp.array(seen), strict=True))
    noisy = replace(quiet, measured=quiet.measured + 0.1, **known)
    steps = to_single_steps(noisy, None)
    shape = quiet.truth.shape
    before = np.asarray(pack_motion(steps.initial)).reshape(shape)
    after = np.asarray(steps.truth).reshape(shape)
    np.testing.assert_array_equal(after, quiet.truth)
    np.testing.assert_array_equal(steps.measured, steps.truth[..., :3])
    for name, wanted in known.items():
        found = np.asarray(getattr(steps, name)).reshape(shape[:2])
        np.testing.assert_array_equal(found, wanted)
    np.testing.assert_array_equal(before[:, 1:], after[:, :-1])
    np.testing.assert_array_equal(before[:, 0], pack_motion(quiet.initial))
    for name in ("position", "velocity"):
        pusher = getattr(steps.initial, f"pusher_{name}").reshape(*shape[:2], 2)
        command = getattr(quiet.controls, name)
        np.testing.assert_array_equal(pusher[:, 1:], command[:, :-1])
    np.testing.assert_array_equal(pusher[:, 0], 0)
    assert steps.simulated is None


def test_restarting_a_memoryless_engine_changes_nothing():
    world = pushes("robot", 2)
    plain = PhysicsDynamics(engine("planar"))
    found = predict(Restarted(plain), *world).states
    wanted = predict(plain, *world).states
    np.testing.assert_allclose(pack_motion(found), pack_motion(wanted), atol=1e-4)
    np.testing.assert_allclose(found.pusher_position, wanted.pusher_position, atol=1e-6)


@pytest.mark.parametrize("name", ["in", "sain"])
def test_training_predicts_a_step_as_the_restarted_model_does(quiet, name):
    # Every step from the previous true state: both forms must agree.
    net, inside = network(name, "robot"), engine("planar")
    steps = to_single_steps(quiet, inside if name == "sain" else None)
    found = predict_batch(net, steps)[0]
    plain = SimulatorAugmented(net, inside) if name == "sain" else LearnedDynamics(net)
    world = steps.scene, steps.initial, steps.controls
    reached = pack_motion(predict(Restarted(plain), *world).final)
    wanted = motion_to_frame(reached, push_frame(steps.scene, steps.initial))
    np.testing.assert_allclose(found, wanted, atol=2e-5)


def test_a_restarted_model_keeps_no_state():
    # Two steps: the second is a push of its own from where the first one ended.
    model = SimulatorAugmented(network("sain", "robot"), Glide())
    scene, initial, controls = pushes("robot", 2, 2)
    one, two = (
        jax.tree.map(lambda x, i=i: x[:, i : i + 1], controls) for i in range(2)
    )
    first = predict(model, scene, initial, one).final
    wanted = predict(model, scene, first, two).final
    found = predict(Restarted(model), scene, initial, controls).final
    np.testing.assert_allclose(pack_motion(found), pack_motion(wanted), atol=1e-6)
    open_loop = predict(model, scene, initial, controls).final
    assert np.abs(pack_motion(open_loop) - pack_motion(found)).max() > 1e-4


def test_force_driven_pushes_cannot_restart():
    model = Restarted(PhysicsDynamics(engine("planar")))
    with pytest.raises(BadInput, match="a force drives"):
        predict(model, *pushes("direct-force", 2))


def test_the_card_records_single_step_training(trained):
    found = np.array([line.loss for line in trained.history])
    assert found[-2:].mean() < 0.8 * found[0]
    assert read_card(trained.folder).has_single_steps
    model = load_model(str(trained.folder)).dynamics
    assert isinstance(model, Restarted)
    assert isinstance(model.model, SimulatorAugmented)


def test_recorded_and_force_driven_pushes_are_refused(store, tmp_path):
    recorded = info_of(10, engine="recorded", seed=None)
    pushed = GenerateConfig(setup="direct-force", pushes=4, chunk_size=4, force_steps=8)
    for data in (
        write(tmp_path / "recorded", recorded, made_up(recorded)),
        generate(pushed, tmp_path / "force"),
    ):
        with pytest.raises(BadStore, match=f"{data.path}: single steps"):
            fit("sain", data, CONFIG, tmp_path / "out")
    assert not (tmp_path / "out").exists()


@pytest.fixture(scope="module")
def around_bullet(tmp_path_factory):
    info = info_of(10, assumed_engines=("bullet",))
    arrays = made_up(info)
    arrays["simulated_bullet"] = arrays.pop("simulated_planar")
    return write(tmp_path_factory.mktemp("bullet") / "data", info, arrays)


def test_bullet_cannot_restart_in_a_training(around_bullet, tmp_path):
    with pytest.raises(BadInput, match="`engine` is bullet"):
        fit("sain", around_bullet, CONFIG, tmp_path / "out", engine="bullet")


def test_in_needs_no_restarting_engine(around_bullet):
    bullet = find_internal_engine("bullet")
    task = Task("in", around_bullet, CONFIG, bullet)
    check_task(task)
    state, _ = Mixture((task,)).begin()
    assert np.isfinite(state.network.scales.body_deviation).all()


def test_single_step_networks_are_refused_around_bullet(trained):
    says = "recipe.horizon is single-steps.*`engine` planar"
    with pytest.raises(BadCheckpoint, match=says):
        load_model(str(trained.folder), engine="bullet", force=True)
