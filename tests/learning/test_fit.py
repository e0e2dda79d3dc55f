"""The training loop on tiny stores: it learns, resumes, and refuses what cannot be."""

import json
import re
import signal
from contextlib import suppress
from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from learning.stores import (
    QUIET,
    end_points_alone,
    info_of,
    made_up,
    quiet_store,
    write,
)
from sainet.datasets.batch import to_batch
from sainet.datasets.generate import generate
from sainet.datasets.schema import simulated_name
from sainet.learning import fit as fit_module
from sainet.learning import sources as sources_module
from sainet.learning.batches import predict_batch
from sainet.learning.fit import fit
from sainet.learning.job import STATE
from sainet.learning.log import LOG, LogLine, append_log, read_log, rewind_log
from sainet.learning.mixture import Mixture
from sainet.learning.recipes import PAPER
from sainet.learning.task import Task
from sainet.models.card import CARD, WEIGHTS, read_card
from sainet.models.checkpoint import load_network
from sainet.models.dynamics import SimulatorAugmented, predict
from sainet.models.library import find_internal_engine, load_model
from sainet.runs.documents import content_hash
from sainet.runs.errors import BadCheckpoint, BadInput, BadStore, Diverged, RunConflict
from sainet.runs.interrupts import remembered_interrupts
from sainet.runs.manifest import MANIFEST
from sainet.scenes.state import pack_motion

PLANAR = find_internal_engine("planar")
CONFIG = PAPER.changed(
    iterations=60,
    batch_size=8,
    log_every=5,
    checkpoint_every=20,
    validation_share=1 / 6,
    learning_rate=3e-3,
)


class Stopped(Exception):
    """What an impatient user raises."""


@pytest.fixture(scope="session")
def store(tmp_path_factory):
    return quiet_store(tmp_path_factory.getbasetemp())


@pytest.fixture(scope="session")
def trained(store, tmp_path_factory):
    return fit("sain", store, CONFIG, tmp_path_factory.mktemp("run") / "out")


def contents(folder):
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def losses(result, name):
    return np.array([getattr(line, name) for line in result.history])


def test_training_reduces_training_and_test_losses(trained):
    for name in ("loss", "validation_loss"):
        found = losses(trained, name)
        assert found[-3:].mean() < 0.75 * found[0]


def test_a_training_run_writes_network_card_and_log(trained, store):
    files = contents(trained.folder)
    assert files.keys() == {"config.json", MANIFEST, LOG, WEIGHTS, CARD}
    card = read_card(trained.folder)
    assert card.weights == content_hash(files[WEIGHTS])
    assert (card.kind, card.truth_engine) == ("robot", "planar")
    assert card.data == store.content
    assert card.manifest.devices == jax.device_count()
    assert read_log(trained.folder) == trained.history
    assert [line.iteration for line in trained.history] == list(range(5, 61, 5))
    assert load_model(str(trained.folder)).card == card


def test_a_finished_run_stays_unchanged(trained, store):
    before = contents(trained.folder)
    steps = []
    count = lambda *step: steps.append(step)  # noqa: E731
    again = fit("sain", store, CONFIG, trained.folder, on_step=count)
    assert (steps, again.history) == ([], trained.history)
    assert contents(trained.folder) == before


def test_a_swallowed_interrupt_ends_training_before_the_next_iteration(store, tmp_path):
    seen = []

    def on_step(iteration, loss):
        seen.append(iteration)
        if iteration == 2:
            with suppress(KeyboardInterrupt):  # as Python does in a finaliser
                signal.raise_signal(signal.SIGINT)

    with pytest.raises(KeyboardInterrupt), remembered_interrupts():
        fit("sain", store, CONFIG, tmp_path / "out", on_step=on_step)
    assert seen == [1, 2]


def test_other_settings_touch_nothing(trained, store):
    before = contents(trained.folder)
    other = ("sain", CONFIG.changed(seed=1)), ("in", CONFIG)
    for name, changed in (*other, ("sain", CONFIG.changed(log_every=4))):
        with pytest.raises(RunConflict, match=r"json: (seed|model|log_every) is"):
            fit(name, store, changed, trained.folder)
    assert contents(trained.folder) == before


def test_a_foreign_folder_is_refused(store, tmp_path):
    (tmp_path / "thesis.tex").write_text("years of work")
    with pytest.raises(RunConflict, match="not a sainet run folder"):
        fit("in", store, CONFIG, tmp_path)
    assert contents(tmp_path) == {"thesis.tex": b"years of work"}


def test_the_stored_prediction_equals_the_engines(trained, store):
    made = load_model(str(trained.folder)).dynamics
    assert isinstance(made, SimulatorAugmented)
    arrays = store.read(slice(0, 6))
    batch = to_batch(arrays, store.info, simulated="planar")
    parts = (batch.scene, batch.initial, batch.controls)
    s_bar = eqx.filter_jit(made.engine.rollout)(*parts).states
    stored = arrays[simulated_name("planar")]
    np.testing.assert_allclose(pack_motion(s_bar), stored, atol=2e-6, rtol=1e-5)
    # So training and prediction are the same computation, in two frames.
    network, _ = load_network(trained.folder)
    local = np.asarray(predict_batch(network, batch))
    table = np.asarray(pack_motion(predict(made, *parts).states))
    np.testing.assert_allclose(
        np.linalg.norm(np.diff(local[..., :2], axis=0), axis=-1),
        np.linalg.norm(np.diff(table[..., :2], axis=1), axis=-1).swapaxes(0, 1),
        atol=1e-6,
    )
    np.testing.assert_allclose(
        local[..., 5], table[..., 5].swapaxes(0, 1), atol=1e-4, rtol=1e-3
    )


def test_pushes_with_only_final_poses_can_be_trained_on(tmp_path):
    # Of IN: all that its statistics can be of is the stored prediction of an engine.
    info = info_of(10, bodies=1, engine="recorded", seed=None)
    lengths = [12] * 7 + [7] * 3
    store = write(tmp_path / "data", info, end_points_alone(made_up(info, lengths)))
    config = PAPER.changed(iterations=8, batch_size=4, log_every=1, steps=12)
    result = fit("in", store, config, tmp_path / "out")
    found = losses(result, "loss")
    assert np.isfinite(found).all()
    state, (weights,) = Mixture((Task("in", store, config, PLANAR),)).begin()
    after, before = load_network(tmp_path / "out")[0].dyn, state.network.dyn
    moved = jax.tree.map(lambda a, b: float(abs(a - b).max()), after, before)
    assert min(jax.tree.leaves(moved)) > 1e-4  # no step was skipped as not finite
    # What is not known of the truth is s-bar, never a disk at 0 m.
    arrays = store.read(slice(None))
    known = np.where(
        np.isnan(arrays["truth"]), arrays["simulated_planar"], arrays["truth"]
    )
    way = (known - arrays["initial"][:, None])[..., :2].astype(float)
    wanted = 1 / (way**2).sum(-1).mean()
    assert float(weights.position) == pytest.approx(wanted, rel=1e-3)


def never_learns(loss):
    """A stand-in for `make_step` that costs nothing."""
    found = jnp.float32(loss)
    return lambda config, weights, start: lambda state, batch: (state, found)


def test_memory_of_training_is_that_of_a_few_chunks(store, tmp_path, monkeypatch):
    task = Task("sain", store, CONFIG, PLANAR)
    chunk = sum(a.nbytes for a in store.read(slice(0, 8), task.names).values())
    readers = []
    reader = sources_module.BatchReader

    def small(*args, **words):
        readers.append(reader(*args, **words, memory=chunk))
        return readers[-1]

    monkeypatch.setattr(sources_module, "BatchReader", small)
    monkeypatch.setattr(fit_module, "make_step", never_learns(1.0))
    fit("sain", store, CONFIG.changed(validation_share=0.0), tmp_path / "out")
    (used,) = readers
    assert used._cache._size <= chunk
    assert "truth_pusher" not in used.names


def started(store, folder, monkeypatch):
    """A run that was stopped before its first step."""

    def stop(*args, **settings):
        raise Stopped

    with monkeypatch.context() as patch:
        patch.setattr(fit_module, "_iterate", stop)
        with pytest.raises(Stopped):
            fit("sain", store, CONFIG, folder)


@pytest.mark.parametrize("name", ["devices", "processor", "versions"])
def test_resuming_on_another_machine_warns(store, tmp_path, monkeypatch, name):
    started(store, tmp_path, monkeypatch)
    started(store, tmp_path, monkeypatch)  # the same machine: no warning
    found = json.loads((tmp_path / MANIFEST).read_text())
    del found["versions"]["scipy"]  # older manifests do not name it: no warning
    (tmp_path / MANIFEST).write_text(json.dumps(found))
    started(store, tmp_path, monkeypatch)
    other = {"devices": 99, "processor": "other", "versions": {"jax": "0.0"}}
    (tmp_path / MANIFEST).write_text(json.dumps(found | {name: other[name]}))
    with pytest.warns(UserWarning, match=re.escape(f"{name} was {other[name]}")):
        started(store, tmp_path, monkeypatch)


def test_a_damaged_checkpoint_is_named(store, tmp_path, monkeypatch):
    started(store, tmp_path, monkeypatch)
    (tmp_path / STATE).write_bytes(b"half a checkpoi")
    with pytest.raises(BadInput, match=STATE):
        fit("sain", store, CONFIG, tmp_path)


def test_a_loss_of_nan_stops_the_training(store, tmp_path, monkeypatch):
    monkeypatch.setattr(fit_module, "make_step", never_learns(float("nan")))
    with pytest.raises(Diverged, match="`learning_rate`"):
        fit("in", store, CONFIG, tmp_path / "out")
    assert not (tmp_path / "out" / CARD).exists()


def test_data_without_the_internal_engine_are_refused(store, tmp_path):
    says = "no simulator prediction of bullet; use planar, or the folder"
    with pytest.raises(BadStore, match=says):
        fit("sain", store, CONFIG, tmp_path / "out", engine="bullet")
    assert not (tmp_path / "out").exists()


def test_a_prediction_that_the_data_lack_is_computed(store, tmp_path):
    both = replace(QUIET, assumed_engine=("planar", "planar-overlap"))
    stores = generate(both, tmp_path / "both"), store
    recipe = CONFIG.changed(iterations=5)
    trained = [
        fit("sain", each, recipe, tmp_path / name, engine="planar-overlap")
        for name, each in zip(("stored", "computed"), stores, strict=True)
    ]
    networks = (load_network(each.folder)[0] for each in trained)
    first, second = (jax.tree.leaves(eqx.filter(n, eqx.is_array)) for n in networks)
    assert len(first) == len(second) > 10
    for one, other in zip(first, second, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-4, atol=1e-6)


def test_at_least_one_push_remains_for_training(store, tmp_path):
    with pytest.raises(BadInput, match="`validation_share` is 0.1.*no two pushes"):
        fit("sain", store.first(1), CONFIG, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_a_log_drops_lines_after_the_checkpoint(tmp_path):
    lines = (LogLine(5, 0.2), LogLine(10, 0.1, 0.3), LogLine(15, 0.05))
    for line in lines:
        append_log(tmp_path, line)
    with (tmp_path / LOG).open("a") as file:
        file.write('{"iteration": 20, "lo')
    assert read_log(tmp_path) == lines
    assert rewind_log(tmp_path, 10) == lines[:2]
    assert read_log(tmp_path) == lines[:2]


@pytest.mark.parametrize("checked", [np.nan, np.inf])
def test_every_line_that_training_writes_can_be_read(tmp_path, checked):
    append_log(tmp_path, LogLine(5, 2e9, checked))
    assert read_log(tmp_path) == (LogLine(5, 2e9),)


@pytest.mark.parametrize(
    "line",
    [b"{", b"[]", b'{"loss": 1}', b'{"iteration": 1, "loss": "x"}', b"\xff", b""],
)
def test_a_damaged_line_of_a_log_is_named(tmp_path, line):
    append_log(tmp_path, LogLine(5, 1.0))
    with (tmp_path / LOG).open("ab") as file:
        file.write(line + b"\n")
    says = rf"^{re.escape(str(tmp_path / LOG))}: line 2 is damaged.*run the same"
    with pytest.raises(BadCheckpoint, match=says):
        read_log(tmp_path)


def test_pushes_are_short_in_the_first_iterations(store):
    recipe = PAPER.changed(batch_size=4, steps=10, short_iterations=3)
    task = Task("sain", store, recipe, PLANAR)
    arrays = store.read(slice(0, 4), task.names)
    for most, taken in (
        (8, {3: 3, 4: 8}),
        (2, {3: 2, 4: 2}),
        (99, {1: 3, 3: 3, 4: 10}),
    ):
        for iteration, steps in taken.items():
            batch = task.to_training_batch(arrays, most, iteration)
            assert batch.truth.shape[1] == steps
    beyond = Task("sain", store, recipe.changed(steps=10_000), PLANAR)
    quarter = store.info.steps // 4
    assert beyond.to_training_batch(arrays, 40, 1).truth.shape[1] == quarter == 10


def test_short_iterations_resume_to_the_same_weights(store, tmp_path):
    config = CONFIG.changed(
        iterations=30, checkpoint_every=5, steps=8, short_iterations=12
    )
    whole = fit("sain", store, config, tmp_path / "whole")

    def stop(iteration, loss):
        if iteration == 9:
            raise Stopped

    with suppress(Stopped):
        fit("sain", store, config, tmp_path / "part", on_step=stop)
    fit("sain", store, config, tmp_path / "part")
    assert same_weights(whole.folder, tmp_path / "part")
    other = fit("sain", store, config.changed(short_iterations=0), tmp_path / "long")
    assert not same_weights(whole.folder, other.folder)


def same_weights(one, other):
    return (one / WEIGHTS).read_bytes() == (other / WEIGHTS).read_bytes()
