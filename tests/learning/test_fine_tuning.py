"""Fine-tuning a trained network on few pushes with only observed final poses."""

import jax
import numpy as np
import pytest

from learning.stores import end_points_alone, info_of, made_up, write
from models.samples import identified_folder
from sainet.datasets.batch import to_batch, to_initial
from sainet.learning import fit as fit_module
from sainet.learning.batches import predict_batch
from sainet.learning.fit import fit
from sainet.learning.job import Best
from sainet.learning.loss import loss_weights, path_to_frame
from sainet.learning.mixture import Mixture
from sainet.learning.recipes import (
    FINE_TUNING,
    PAPER,
    Fresh,
    FromModel,
    FromSimulator,
)
from sainet.learning.step import trained_layers
from sainet.learning.task import Existing, Task
from sainet.models.card import read_card
from sainet.models.checkpoint import load_arrays, load_network, save_arrays
from sainet.models.dynamics import predict
from sainet.models.inputs import push_frame
from sainet.models.integrators import RelaxingResidual
from sainet.models.library import find_internal_engine, load_model
from sainet.runs.digests import digests_from_text, pushes_overlap
from sainet.runs.errors import (
    BadCheckpoint,
    BadInput,
    BadStore,
    RunConflict,
    UnknownName,
)
from sainet.scenes.state import pack_motion

PLANAR = find_internal_engine("planar")
BEFORE = PAPER.changed(iterations=3, batch_size=4, steps=12, log_every=1)
TUNING = FINE_TUNING.changed(
    start=Fresh(),
    iterations=8,
    batch_size=4,
    validation_share=0.2,
    log_every=1,
    checkpoint_every=2,
)


@pytest.fixture(scope="module")
def store(tmp_path_factory):
    info = info_of(20, engine="recorded", seed=None)
    arrays = end_points_alone(made_up(info))
    return write(tmp_path_factory.mktemp("recorded") / "data", info, arrays)


@pytest.fixture(scope="module")
def start(tmp_path_factory):
    folder = tmp_path_factory.mktemp("start")
    info = info_of(20)
    simulated = write(folder / "data", info, made_up(info, seed=1))
    for model in ("in", "sain"):
        fit(model, simulated, BEFORE, folder / model)
    return folder


def starting(recipe, network):
    return recipe.changed(start=FromModel(str(network)))


def layers(folder):
    return jax.tree.leaves(load_network(folder)[0])


def test_fine_tuning_starts_from_the_network_and_records_it(store, start, tmp_path):
    out = tmp_path / "out"
    fit("sain", store, starting(TUNING, start / "sain"), out)
    card, before = read_card(out), read_card(start / "sain")
    assert card.started_from == before.weights
    assert before.data_seeds == card.data_seeds == ()
    trained = len(digests_from_text(before.pushes))
    assert trained > 0
    assert len(digests_from_text(card.pushes)) == trained + store.info.pushes
    assert pushes_overlap(card.pushes, store.push_hashes()) == store.info.pushes
    assert (card.truth_engine, card.identity.features) == ("recorded", "paper")
    task = Task("sain", store, TUNING, PLANAR, load(start / "sain"))
    first = Mixture((task,)).begin()[0].network
    for found, known in zip(
        jax.tree.leaves(first), layers(start / "sain"), strict=True
    ):
        np.testing.assert_array_equal(found, known)
    changed = [
        np.abs(a - b).max()
        for a, b in zip(layers(out), layers(start / "sain"), strict=True)
    ]
    assert max(changed) < 0.1  # from there, not from anywhere


def load(folder):
    return Existing(*load_network(folder), folder)


def test_a_network_learns_from_table_features(store, start, tmp_path):
    out = tmp_path / "out"
    seeing = TUNING.changed(features="place", validation_share=0.0)
    fit("in", store, starting(seeing, start / "in"), out)
    network, card = load_network(out)
    assert card.identity.features == "place"
    assert network.features.has_place
    known = load_network(start / "in")[0].features.body_size
    assert np.abs(network.dyn.weights[0][known : known + 6]).max() > 0
    with pytest.raises(BadCheckpoint, match="give `features` place, too"):
        fit("in", store, starting(TUNING, out), tmp_path / "no")


def test_l2_pulls_additive_networks_to_their_initial_weights(store, tmp_path):
    drawn = TUNING.changed(
        start=FromSimulator(), validation_share=0.0, average=0, l2=1e6
    )
    fit("sain", store, drawn, tmp_path / "out")
    task = Task("sain", store, drawn, PLANAR)
    first = trained_layers(Mixture((task,)).begin()[0].network)
    found = trained_layers(load_network(tmp_path / "out")[0])
    # Drawn to zero, each weight would have gone the learning rate at every iteration.
    far = drawn.optimiser.iterations * drawn.optimiser.learning_rate
    for one, other in zip(jax.tree.leaves(found), jax.tree.leaves(first), strict=True):
        assert np.abs(one - other).max() < far / 2


def test_a_fine_tuned_additive_network_stays_additive(store, tmp_path):
    first, on = tmp_path / "first", tmp_path / "on"
    residual = TUNING.changed(start=FromSimulator())
    fit("sain", store, residual, first)
    network, card = load_network(first)
    assert network.integrator == RelaxingResidual()
    assert (card.integrator, card.started_from) == ("relaxing-residual", None)
    assert np.abs(network.dyn.weights[-1]).max() > 0  # it has learned something
    task = Task("sain", store, residual, PLANAR)
    silent = Mixture((task,)).begin()[0].network
    batch = task.to_batch(store.read(slice(None)), store.info.steps)
    frame = push_frame(batch.scene, batch.initial)
    np.testing.assert_allclose(
        predict_batch(silent, batch)[..., 3:],
        path_to_frame(batch.simulated, frame)[..., 3:],
        atol=1e-5,
    )
    seeing = TUNING.changed(features="place")
    fit("sain", store, starting(seeing, first), on)
    assert load_network(on)[0].integrator == RelaxingResidual()
    assert read_card(on).started_from == card.weights
    with pytest.raises(RunConflict, match="start is"):
        fit("sain", store, TUNING, first)
    with pytest.raises(BadInput, match="train sain, or give"):
        fit("in", store, TUNING.changed(start=FromSimulator()), tmp_path / "no")
    assert not (tmp_path / "no").exists()


def test_the_best_network_on_the_validation_pushes_is_kept(
    store, start, tmp_path, monkeypatch
):
    told = iter([0.9, 0.8, 0.3, 0.5, 0.4, 0.6, 0.7, 0.7, 0.7])
    kept = []

    def validation(mixture, weights):
        def validate(network):
            kept.append(network)
            return next(told)

        return validate

    monkeypatch.setattr(Mixture, "validate", validation)
    patient = TUNING.changed(patience=4)
    result = fit(
        "in",
        store,
        starting(patient, start / "in"),
        tmp_path / "out",
    )
    # The first figure is of the start, the third, of iteration 2, is the best.
    assert [line.iteration for line in result.history] == [1, 2, 3, 4, 5, 6]
    for found, wanted in zip(
        layers(tmp_path / "out"), jax.tree.leaves(kept[2]), strict=True
    ):
        np.testing.assert_array_equal(found, wanted)


class Stopped(Exception):
    pass


def test_an_interrupted_tuning_gives_the_same_network(store, start, tmp_path):
    patient = TUNING.changed(patience=6)
    patient = starting(patient, start / "sain")
    fit("sain", store, patient, tmp_path / "whole")

    def stop(iteration, loss):
        if iteration == 3:
            raise Stopped

    with pytest.raises(Stopped):
        fit("sain", store, patient, tmp_path / "cut", on_step=stop)
    fit("sain", store, patient, tmp_path / "cut")
    for name in ("network.safetensors", "log.jsonl"):
        whole, cut = ((tmp_path / run / name).read_bytes() for run in ("whole", "cut"))
        assert whole == cut


@pytest.mark.parametrize(("patience", "last"), [(1, 3), (4, 6)])
def test_only_validation_ends_a_training_run(
    store, tmp_path, monkeypatch, patience, last
):
    losses = iter([0.9, 0.95, 0.95, 0.95, 0.95])  # of the start, then every third
    monkeypatch.setattr(Mixture, "validate", lambda *_: lambda _: next(losses))
    recipe = TUNING.changed(patience=patience, log_every=3)
    result = fit("in", store, recipe, tmp_path / "out")
    assert [line.iteration for line in result.history][-1] == last


def test_a_training_run_that_died_after_its_early_end_only_ends(
    store, tmp_path, monkeypatch
):
    recipe = TUNING.changed(patience=2, learning_rate=1e-9)
    fit("in", store, recipe, tmp_path / "whole")

    def die(job):
        raise Stopped

    with monkeypatch.context() as patched:
        patched.setattr(fit_module, "finish", die)
        with pytest.raises(Stopped):
            fit("in", store, recipe, tmp_path / "cut")
    fit("in", store, recipe, tmp_path / "cut")
    for name in ("network.safetensors", "log.jsonl"):
        whole, cut = ((tmp_path / run / name).read_bytes() for run in ("whole", "cut"))
        assert whole == cut


def test_validation_pushes_are_drawn_at_random_and_not_trained_on(store):
    task = Task("in", store, TUNING, PLANAR)
    training, validation = set(task.training.rows), set(task.validation.rows)
    assert (len(training), len(validation)) == (16, 4)
    assert training | validation == set(range(20))
    other = Task("in", store, TUNING.changed(seed=1), PLANAR)
    assert set(other.validation.rows) != validation
    assert validation != set(range(16, 20))
    for share in (0.01, 0.99):  # of two pushes, one remains on either side
        few = Task("in", store.first(2), TUNING.changed(validation_share=share), PLANAR)
        assert (len(few.training.rows), len(few.validation.rows)) == (1, 1)


def test_repeats_stay_together_in_validation(tmp_path):
    info = info_of(40, engine="recorded", seed=None, has_repeats=True)
    repeat = np.random.default_rng(0).permutation(np.repeat(np.arange(8), 5))
    arrays = end_points_alone(made_up(info)) | {"repeat": repeat}
    task = Task("in", write(tmp_path / "data", info, arrays), TUNING, PLANAR)
    assert task.training.info.pushes + task.validation.info.pushes == 40
    assert not set(task.training.repeats()) & set(task.validation.repeats())
    assert task.validation.info.pushes in (5, 10)  # 8 of them would cut a kind


def test_sain_learns_around_an_identified_engine(store, start, tmp_path):
    """Its prediction is computed, because the store has none; the card is complete."""
    values = {"pusher_friction": 0.2, "pressure_radius_ratio": 0.5, "camera_x_mm": 1.5}
    internal = identified_folder(tmp_path / "engine", **values)
    words = {"engine": str(tmp_path / "engine")}
    out = tmp_path / "out"
    fit(
        "sain",
        store,
        starting(TUNING, start / "sain"),
        out,
        **words,
    )
    card = read_card(out)
    assert card.internal == internal
    model = load_model(str(out)).dynamics
    assert model.offset.vector == (1.5e-3, 0.0)
    assert model.dynamics.engine.assumptions == internal.simulator.assumptions
    fit(
        "sain",
        store,
        starting(TUNING, out),
        tmp_path / "on",
        **words,
    )
    with pytest.raises(BadCheckpoint, match="internal engine is 'planar-"):
        fit("sain", store, starting(TUNING, out), tmp_path / "no")
    task = Task("sain", store, TUNING, find_internal_engine(str(tmp_path / "engine")))
    arrays = store.read(slice(0, 4), task.names)
    assert "simulated_planar" not in arrays
    batch = task.to_batch(arrays, 12)
    wanted = internal.simulator.build().rollout(
        batch.scene, batch.initial, batch.controls
    )
    np.testing.assert_allclose(
        batch.simulated, pack_motion(wanted.states), rtol=1e-4, atol=1e-6
    )
    moved = np.asarray(batch.initial.pusher_position) - arrays["initial_pusher"]
    np.testing.assert_allclose(moved, [[1.5e-3, 0]] * 4, atol=1e-7)
    # What training predicts is what the model does with what was recorded.
    controls = to_batch(arrays, store.info, steps=12).controls
    found = predict(model, batch.scene, to_initial(arrays), controls)
    local = path_to_frame(
        pack_motion(found.states), push_frame(batch.scene, batch.initial)
    )
    trained = predict_batch(load_network(out)[0], batch)
    np.testing.assert_allclose(local, trained, rtol=1e-3, atol=2e-5)


def test_error_terms_are_scaled_by_the_residual(store):
    batch = to_batch(store.read(slice(None)), store.info, simulated="planar")
    found = loss_weights(batch, TUNING.objective)
    last = np.asarray(batch.truth - batch.simulated, np.float64)[:, -1]
    place = np.mean(np.sum(last[..., :2] ** 2, axis=-1))
    np.testing.assert_allclose(found.position, 1 / place, rtol=1e-4)
    np.testing.assert_allclose(found.rotation, 1 / np.mean(last[..., 2] ** 2), 1e-4)
    # No velocity was observed: there is nothing to measure it by.
    assert (float(found.velocity), float(found.spin)) == (1.0, 1.0)


def test_invalid_starting_networks_are_refused(store, start, tmp_path):
    out = tmp_path / "out"
    with pytest.raises(BadCheckpoint, match="kind is 'in', this training's is 'sain'"):
        fit("sain", store, starting(TUNING, start / "in"), out)
    for name in ("nowhere", "physics"):
        says = f"`start` is '{name}'; it must be engine, in, sain, .*folder"
        with pytest.raises(UnknownName, match=says):
            fit("in", store, starting(TUNING, name), out)
    assert not out.exists()


def test_a_network_around_another_engine_is_refused(store, tmp_path):
    with pytest.raises(BadCheckpoint, match="internal engine is 'bullet'"):
        fit(
            "sain",
            store,
            starting(TUNING, "sain-bullet"),
            tmp_path / "out",
        )


def test_an_engine_that_assumes_quite_other_disks_is_named(tmp_path, caplog):
    info = info_of(6, bodies=2)
    arrays = made_up(info)
    arrays["mass"] = np.ones_like(arrays["mass"])
    small = write(tmp_path / "small", info, arrays | {"radius": arrays["radius"] / 2})
    fit("sain", small, TUNING.changed(iterations=1), tmp_path / "sain")
    (said,) = caplog.messages
    assert "radius is 0.02" in said
    assert "the internal engine assumes 0.0525, 0.058 m; take planar-true" in said
    caplog.clear()
    fit("in", small, TUNING.changed(iterations=1), tmp_path / "in")
    usual = write(tmp_path / "usual", info, arrays)
    fit("sain", usual, TUNING.changed(iterations=1), tmp_path / "usual-sain")
    assert not caplog.messages


def test_a_horizon_before_the_first_observation_is_refused(tmp_path):
    info = info_of(6, bodies=2)
    store = write(tmp_path / "ends", info, end_points_alone(made_up(info)))
    lengths = np.where(np.arange(6) % 2, 6, 12)
    arrays = end_points_alone(made_up(info, lengths))
    uneven = write(tmp_path / "uneven", info, arrays)
    short = {"steps": 12, "short_iterations": 2}
    for each, settings, says in (
        (store, {"steps": 8}, "push of 12 steps is observed in its first 8; train on"),
        (uneven, {"steps": 6}, "of 12 steps is observed in its first 6; .* `steps`.$"),
        (uneven, short, "of 6 steps is observed in its first 3.* `short_iterations`.$"),
    ):
        with pytest.raises(BadStore, match=says):
            fit("in", each, TUNING.changed(**settings), tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_batches_without_an_observation_count_nothing(tmp_path):
    """No push of six steps was observed; nor was any of some batches of twelve."""
    info = info_of(12, bodies=2)
    lengths = np.where(np.arange(12) % 2, 6, 12)
    arrays = end_points_alone(made_up(info, lengths))
    arrays["pose_observed"][1:-2] = False
    arrays["pose_observed"][-1] = False
    store = write(tmp_path / "ends", info, arrays)
    recipe = TUNING.changed(batch_size=1, validation_share=0.0)
    losses = [line.loss for line in fit("in", store, recipe, tmp_path / "out").history]
    assert np.isfinite(losses).all()
    assert 0.0 in losses


def test_validation_pushes_need_an_observation(tmp_path):
    info = info_of(20, bodies=2)
    arrays = end_points_alone(made_up(info))
    kept = Task("in", write(tmp_path / "all", info, arrays), TUNING, PLANAR).validation
    arrays["pose_observed"][np.array(kept.rows)] = False
    store = write(tmp_path / "ends", info, arrays)
    with pytest.raises(BadStore, match="no validation push is observed in its first"):
        fit("in", store, TUNING, tmp_path / "out")


def test_validation_takes_whole_pushes_also_where_training_begins_with_short_ones(
    tmp_path,
):
    info = info_of(20, bodies=2)
    arrays = made_up(info)
    recipe = TUNING.changed(steps=12, short_iterations=2, validation_share=0.2)
    kept = Task("in", write(tmp_path / "all", info, arrays), recipe, PLANAR).validation
    arrays["pose_observed"][np.array(kept.rows), :5] = False
    arrays["rate_observed"][np.array(kept.rows), :5] = False
    store = write(tmp_path / "late", info, arrays)
    done = fit("in", store, recipe, tmp_path / "out")
    assert np.isfinite([line.loss for line in done.history]).all()


def test_patience_needs_pushes_to_validate_on():
    with pytest.raises(BadInput, match="`patience` is 5"):
        PAPER.changed(patience=5)
    for share in (1.0, 1.5, float("nan")):
        with pytest.raises(BadInput, match="`validation_share`"):
            PAPER.changed(validation_share=share)


def test_an_equal_loss_is_no_improvement(start):
    network = load_network(start / "in")[0]
    best = Best.first(network, 0.5)
    assert best.or_better(network, 0.5, 7) is best
    assert best.or_better(network, float("nan"), 7) is best
    assert int(best.or_better(network, 0.4, 7).iteration) == 7
    assert [best.is_stale(i, 3) for i in (2, 3)] == [False, True]
    assert not best.is_stale(10_000, 0)


@pytest.mark.parametrize("loss", [float("nan"), float("inf")])
def test_a_first_loss_that_is_not_finite_is_replaced_and_resumed(start, tmp_path, loss):
    network = load_network(start / "in")[0]
    best = Best.first(network, loss)
    assert best.or_better(network, loss, 7) is best
    assert int(best.or_better(network, 1e6, 7).iteration) == 7
    save_arrays(tmp_path / "best", best)
    assert int(load_arrays(tmp_path / "best", best).iteration) == 0
