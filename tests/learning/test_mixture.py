"""One network of datasets with several numbers of disks: reproducible, resumable."""

import re
from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from msgspec import structs

from learning.stores import info_of, made_up, write
from sainet.cli.entry import run
from sainet.evaluation.unlike import doubts_of_count
from sainet.learning import fit as fit_module
from sainet.learning.fit import fit
from sainet.learning.job import STATE
from sainet.learning.loss import CONSTANT
from sainet.learning.mixture import Batches, Mixture, _check_alike, pool
from sainet.learning.recipes import CONTACT, PAPER, FromModel
from sainet.learning.sources import source_of
from sainet.learning.step import data_loss, even_batch
from sainet.learning.task import Task
from sainet.models.card import WEIGHTS, read_card
from sainet.models.checkpoint import load_network
from sainet.models.correctors.network import Scales
from sainet.models.library import find_internal_engine, load_model
from sainet.runs.errors import BadInput, BadStore

RECIPE = CONTACT.changed(
    iterations=6, batch_size=4, average=2, checkpoint_every=2, log_every=1
)
SIZES = {1: 6, 2: 12, 3: 6}  # pushes by the number of disks


@pytest.fixture(scope="module")
def stores(tmp_path_factory):
    folder = tmp_path_factory.mktemp("mixture")

    def one(disks):
        info = info_of(SIZES[disks], bodies=disks)
        return write(folder / f"of-{disks}", info, made_up(info, seed=disks))

    return [one(disks) for disks in SIZES]


def mixture(stores, recipe=RECIPE):
    engine = find_internal_engine("planar")
    return Mixture(tuple(Task("sain", each, recipe, engine) for each in stores))


def test_a_batch_has_one_number_of_disks_and_each_its_share(stores):
    batches = Batches(mixture(stores, RECIPE.changed(iterations=400)))
    found = [batches.take(iteration) for iteration in range(1, 401)]
    batches.close()
    assert all(batch.truth.shape[2] == turn + 1 for turn, batch in found)
    share = np.bincount([turn for turn, _ in found]) / 400
    np.testing.assert_allclose(share, [0.25, 0.5, 0.25], atol=0.06)


def test_each_dataset_gives_its_batches_in_its_own_order(stores):
    """Mirrored by the iteration, and filled up for all devices."""
    of = mixture(stores, RECIPE.changed(iterations=24, batch_size=3, mirror=True))
    batches, sources = Batches(of), [source_of(task) for task in of.tasks]
    turns = []
    for iteration in range(1, 25):
        turn, batch = batches.take(iteration)
        wanted = even_batch(sources[turn].take(turns.count(turn), iteration))
        assert all(jax.tree.leaves(jax.tree.map(np.array_equal, batch, wanted)))
        turns.append(turn)
    for each in (batches, *sources):
        each.close()
    with pytest.raises(RuntimeError, match="after shutdown"):
        batches.take(1)
    other = Batches(mixture(stores, RECIPE.changed(iterations=24, seed=1)))
    assert turns != [other.take(iteration)[0] for iteration in range(1, 25)]
    other.close()


def test_the_validation_loss_is_the_mean_over_the_pushes_of_all_datasets(stores):
    of = mixture(stores[:2], RECIPE.changed(validation_share=0.3))
    state, weights = of.begin()
    total, loss, counts = 0.0, jax.jit(data_loss), []
    for task, each in zip(of.tasks, weights, strict=True):
        kept = task.validation
        counts.append(kept.info.pushes)
        batch = task.to_batch(kept.read(slice(None), task.names), 12)
        total += float(loss(state.network, batch, each))
    assert counts[0] < counts[1]
    found = of.validate(weights)(state.network)
    assert found == pytest.approx(total / sum(counts), rel=1e-5)
    assert mixture(stores).validate(weights) is None


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"engine": "recorded"}, "engine is 'recorded', that of .* is 'planar'"),
        ({"kind": "direct-force"}, "kind is 'direct-force', that of .* is 'robot'"),
    ],
)
def test_datasets_of_several_setups_are_refused(stores, change, message):
    store = stores[0]
    info = structs.replace(store.info, **change)
    with pytest.raises(BadStore, match=message):
        _check_alike(store, replace(store, info=info))


def test_networks_on_the_whole_state_take_one_number_of_disks(stores):
    of = mixture(stores, PAPER.changed(features="whole-state"))
    with pytest.raises(BadStore, match="pushes of 2 disks, not 1; a network on the"):
        of.check()


def test_an_interrupted_mixture_ends_with_the_same_network(
    stores, tmp_path, monkeypatch
):
    fit("sain", stores, RECIPE, tmp_path / "whole")
    steps = iter(range(4))

    def stop():
        if next(steps, None) is None:
            raise KeyboardInterrupt

    monkeypatch.setattr(fit_module, "raise_if_interrupted", stop)
    with pytest.raises(KeyboardInterrupt):
        fit("sain", stores, RECIPE, tmp_path / "cut")
    assert (tmp_path / "cut" / STATE).is_file()
    monkeypatch.undo()
    fit("sain", stores, RECIPE, tmp_path / "cut")
    whole, cut = ((tmp_path / name / WEIGHTS).read_bytes() for name in ("whole", "cut"))
    assert whole == cut
    card = read_card(tmp_path / "whole")
    assert (card.numbers_of_disks, card.disks) == ((1, 2, 3), 3)
    assert card.trained_pushes == sum(SIZES.values())
    model = load_model(str(tmp_path / "whole"))
    assert not [*doubts_of_count(model.card, 2)]
    (doubt,) = doubts_of_count(model.card, 5)
    assert "1 to 3" in doubt
    assert "5" in doubt


@pytest.mark.parametrize("hold", [1, 3])
def test_a_contact_network_is_loaded_with_the_hold_that_it_was_trained_with(
    stores, tmp_path, hold
):
    fit("sain", stores[1], RECIPE.changed(iterations=2), tmp_path / "first")
    start = FromModel(str(tmp_path / "first"))
    further = RECIPE.changed(iterations=1, start=start, hold=hold)
    fit("sain", stores[1], further, tmp_path / "further")
    holds = [load_network(tmp_path / name)[0].hold for name in ("first", "further")]
    assert holds == [CONTACT.horizon.hold, hold]


def test_the_papers_networks_train_on_mixtures_too(stores, tmp_path):
    recipe = PAPER.changed(iterations=2, batch_size=4, steps=12)
    fit("in", stores[1:], recipe, tmp_path / "in")
    assert read_card(tmp_path / "in").numbers_of_disks == (2, 3)


def test_pooled_statistics_are_those_of_all_numbers():
    rng = np.random.default_rng(0)
    parts = [rng.normal(shift, spread, (50, 4)) for shift, spread in ((1, 2), (-3, 1))]

    def scales(x, size):
        mean, deviation = jnp.asarray(x.mean(0)), jnp.asarray(x.std(0))
        return Scales(mean, deviation, mean, deviation, jnp.full(3, size))

    found = pool([scales(parts[0], 3.0), scales(parts[1], 4.0)], [2, 3])
    whole = np.concatenate(parts)
    np.testing.assert_allclose(found.body_mean, whole.mean(0), rtol=1e-5)
    np.testing.assert_allclose(found.pair_deviation, whole.std(0), rtol=1e-5)
    np.testing.assert_allclose(found.acceleration, 12.5**0.5, rtol=1e-6)
    without_pairs = pool([scales(parts[0], 3.0), scales(parts[1], 4.0)], [1, 3])
    np.testing.assert_allclose(without_pairs.pair_mean, parts[1].mean(0), rtol=1e-5)


def test_what_varies_in_no_dataset_does_not_widen_what_varies_between_them():
    def scales(mean, deviation, size):
        rounded = np.nextafter(np.float32(0.8), np.float32(1))  # of one dataset
        constant = 0.8 if size == CONSTANT else rounded
        body, pair = jnp.array([mean, constant]), jnp.array([0.0])
        return Scales(
            *(pair, jnp.ones(1), body, jnp.array([deviation, CONSTANT])),
            jnp.array([size, size, CONSTANT]),
        )

    constant = [scales(0.05, CONSTANT, CONSTANT), scales(0.06, CONSTANT, 0.05)]
    found = pool(constant, [2, 3])
    np.testing.assert_allclose(found.body_deviation, [0.005, CONSTANT], rtol=1e-5)
    np.testing.assert_allclose(found.acceleration, [0.05, 0.05, CONSTANT], rtol=1e-5)
    varied = pool([scales(0.05, CONSTANT, 1e-3), scales(0.05, 0.004, 1e-3)], [2, 3])
    np.testing.assert_allclose(varied.body_deviation[0], 0.004 / 2**0.5, rtol=1e-4)


def test_datasets_that_do_not_belong_together_are_refused(stores, tmp_path):
    info = info_of(6, bodies=2, time_step=0.01)
    other = write(tmp_path / "slow", info, made_up(info))
    with pytest.raises(BadStore, match="slow: time_step is 0.01"):
        fit("sain", [stores[1], other], RECIPE, tmp_path / "out")
    info = info_of(6, bodies=3, assumed_engines=("bullet",))
    arrays = made_up(info)
    arrays["simulated_bullet"] = arrays.pop("simulated_planar")
    around = write(tmp_path / "around", info, arrays)
    with pytest.raises(BadStore, match="of-2: no simulator prediction of bullet"):
        fit("sain", [around, stores[1]], RECIPE, tmp_path / "out", engine="bullet")
    with pytest.raises(BadStore, match="[0-9]+ of its pushes are in .*, too"):
        fit("sain", [stores[0], stores[1], stores[0]], RECIPE, tmp_path / "out")
    with pytest.raises(BadInput, match="`data` is empty"):
        fit("sain", [], RECIPE, tmp_path / "out")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["train", "sain", "--features", "contact"], "give `start` engine"),
        (["tune", "in", "--features", "contact"], "in has no internal engine"),
        (["tune", "gp"], "3 datasets.*give one"),
        (["tune", "sain", "--members", "2"], "3 datasets.*give one"),
    ],
)
def test_bad_mixtures_end_in_one_line(stores, words, message, tmp_path, capsys):
    data = [str(each.path) for each in stores]
    given = [*words, "--data", *data, "--out", str(tmp_path / "out"), "--quiet"]
    assert run(given) == 2
    error = capsys.readouterr().err.strip()
    assert "\n" not in error
    assert re.search(message, error)
