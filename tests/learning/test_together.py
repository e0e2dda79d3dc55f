"""Networks that train at once become what each becomes alone."""

from itertools import count

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from learning.stores import info_of, made_up, quiet_store, write
from sainet.learning import sources as sources_module
from sainet.learning import together as together_module
from sainet.learning.fit import fit
from sainet.learning.job import STATE, begin
from sainet.learning.log import read_log
from sainet.learning.mixture import Batches
from sainet.learning.recipes import PAPER
from sainet.learning.together import fit_together
from sainet.models.card import read_card
from sainet.models.checkpoint import load_network
from sainet.runs.errors import Diverged

RECIPE = PAPER.changed(iterations=12, batch_size=8, log_every=3, checkpoint_every=6)
SETTINGS = (
    ("sain", RECIPE),
    ("sain", RECIPE.changed(seed=1)),
    ("sain", RECIPE.changed(l2=1e-2)),
    ("in", RECIPE.changed(seed=2)),
)


@pytest.fixture(scope="session")
def store(tmp_path_factory):
    return quiet_store(tmp_path_factory.getbasetemp())


@pytest.fixture(scope="session")
def alone(store, tmp_path_factory):
    folder = tmp_path_factory.mktemp("alone")
    for number, (model, recipe) in enumerate(SETTINGS):
        fit(model, store, recipe, folder / str(number))
    return folder


def begun(store, folder):
    jobs = [
        begin(model, store, recipe, folder / str(number))
        for number, (model, recipe) in enumerate(SETTINGS)
    ]
    return [job for job in jobs if job is not None]


def assert_alike(folder, other):
    for number in range(len(SETTINGS)):
        found, _ = load_network(folder / str(number))
        wanted, _ = load_network(other / str(number))
        for x, y in zip(jax.tree.leaves(found), jax.tree.leaves(wanted), strict=True):
            np.testing.assert_allclose(x, y, rtol=2e-3, atol=2e-5)
        logs = [read_log(each / str(number)) for each in (folder, other)]
        for one, two in zip(*logs, strict=True):
            assert one.iteration == two.iteration
            assert one.loss == pytest.approx(two.loss, rel=1e-3)
        assert (
            read_card(folder / str(number)).recipe
            == read_card(other / str(number)).recipe
        )


def test_networks_that_train_at_once_are_those_that_train_alone(store, alone, tmp_path):
    steps = []
    fit_together(begun(store, tmp_path), lambda done, loss: steps.append(done))
    assert_alike(tmp_path, alone)
    assert sorted(steps) == sorted([*range(1, 13)] * 2)  # those of SAIN, then IN


def test_pushes_of_two_lengths_train_at_once(tmp_path):
    info = info_of(24)
    arrays = made_up(info, np.where(np.arange(24) % 2, 6, 12))
    uneven = write(tmp_path / "data", info, arrays)
    short = RECIPE.changed(batch_size=4)
    recipes = [short.changed(seed=seed) for seed in range(3)]
    for number, recipe in enumerate(recipes):
        fit("in", uneven, recipe, tmp_path / "alone" / str(number))
    folder = tmp_path / "together"
    fit_together(
        [begin("in", uneven, r, folder / str(n)) for n, r in enumerate(recipes)]
    )
    for number in map(str, range(3)):
        found, wanted = (
            read_log(each / number) for each in (folder, tmp_path / "alone")
        )
        for one, two in zip(found, wanted, strict=True):
            assert one.loss == pytest.approx(two.loss, rel=1e-3)


def test_an_interrupted_run_goes_on_together_or_alone(
    store, alone, tmp_path, monkeypatch
):
    calls = count()

    def stop():
        if next(calls) == 8:
            raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(together_module, "raise_if_interrupted", stop)
        with pytest.raises(KeyboardInterrupt):
            fit_together(begun(store, tmp_path))
    assert (tmp_path / "0" / STATE).is_file() or (tmp_path / "3" / STATE).is_file()
    model, recipe = SETTINGS[0]
    fit(model, store, recipe, tmp_path / "0")
    fit_together(begun(store, tmp_path))
    assert_alike(tmp_path, alone)


def test_a_run_that_was_killed_before_its_card_is_finished(
    store, alone, tmp_path, monkeypatch
):
    def killed(job):
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(together_module, "finish", killed)
        with pytest.raises(KeyboardInterrupt):
            fit_together(begun(store, tmp_path)[:1])
    assert (tmp_path / "0" / STATE).is_file()
    fit_together(begun(store, tmp_path))  # one has no iteration left
    assert_alike(tmp_path, alone)


def test_a_network_that_diverges_leaves_the_others_alone(store, alone, tmp_path):
    jobs = begun(store, tmp_path)
    network = jobs[1].progress.state.network
    ruined = jax.tree.map(lambda x: jnp.full_like(x, jnp.nan), network)
    broken = jobs[1].progress.state
    jobs[1].progress.state = type(broken)(
        ruined, broken.optimizer, broken.iteration, broken.average
    )
    fit_together(jobs)
    assert begin("sain", store, SETTINGS[0][1], tmp_path / "0") is None
    assert begin("sain", store, SETTINGS[2][1], tmp_path / "2") is None
    with pytest.raises(Diverged):
        jobs[1].note(RECIPE.log_every, jnp.array(jnp.nan))


def test_a_network_that_stops_early_is_finished_then(store, tmp_path):
    recipe = RECIPE.changed(validation_share=1 / 6, patience=3, learning_rate=1e-9)
    patient = RECIPE.changed(validation_share=1 / 6, learning_rate=1e-9, patience=99)
    fit("sain", store, recipe, tmp_path / "alone")
    jobs = [
        begin("sain", store, recipe, tmp_path / "early"),
        begin("sain", store, patient, tmp_path / "late"),
    ]
    fit_together(jobs)
    early, late, alone = (
        [line.iteration for line in read_log(tmp_path / name)]
        for name in ("early", "late", "alone")
    )
    assert early == alone
    assert late == [3, 6, 9, 12]


def test_a_dataset_on_the_device_gives_the_batches_that_are_read(store, monkeypatch):
    job_of = lambda: Batches(begun_mixture(store))  # noqa: E731
    read = job_of()
    monkeypatch.setattr(sources_module, "is_one_gpu", lambda: True)
    picked = job_of()
    assert type(picked._sources[0]) is sources_module.Resident
    for iteration in range(1, 8):
        for x, y in zip(
            jax.tree.leaves(read.take(iteration)),
            jax.tree.leaves(picked.take(iteration)),
            strict=True,
        ):
            np.testing.assert_array_equal(x, y)
    again = job_of()
    assert again._sources[0]._whole is picked._sources[0]._whole  # once on the device
    read.close()
    picked.close()


def begun_mixture(store):
    from sainet.learning.mixture import Mixture
    from sainet.learning.task import Task
    from sainet.models.library import find_internal_engine

    return Mixture((Task("sain", store, RECIPE, find_internal_engine("planar")),))
