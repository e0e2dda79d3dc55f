"""Networks trained at once: the same as one by one, and failures as they are."""

from concurrent.futures import Executor, Future
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import replace

import numpy as np
import pytest

from learning.stores import quiet_store
from sainet.learning.log import read_log
from sainet.learning.recipes import PAPER, FromModel
from sainet.models.card import read_card
from sainet.runs.errors import RunConflict, SainetError
from sainet.runs.workers import worker_pool
from sainet.studies.chain import Chain
from sainet.studies.trainings import Training, train_at_once

CONFIG = PAPER.changed(iterations=20, batch_size=8, log_every=5)
SEEDS = (3, 4)


@pytest.fixture(scope="module")
def store(tmp_path_factory):
    return quiet_store(tmp_path_factory.getbasetemp())


class Broken(Executor):
    """Processes of which none lives."""

    def submit(self, fn, /, *args, **kwargs):
        future = Future()
        future.set_exception(BrokenProcessPool())
        return future


class Gone(Executor):
    """Processes of which one was ended before they were given work."""

    def submit(self, fn, /, *args, **kwargs):
        raise BrokenProcessPool


class Bars:
    """A progress bar that records its calls."""

    def __init__(self):
        self.told = {}

    @contextmanager
    def __call__(self, title, total):
        self.told[title] = [total, 0]

        def advance(amount, note):
            self.told[title][1] += amount

        yield advance


def chain_of(folder, trainers=None):
    bars = Bars()
    return Chain(folder, Broken(), print, bars, trainers=trainers), bars


def both(store, folder):
    return {
        name: Training(name, store, CONFIG, folder / f"{name}-form")
        for name in ("in", "sain")
    }


@pytest.mark.slow
def test_parallel_training_gives_the_same_networks(store, tmp_path):
    alone, bars_alone = chain_of(tmp_path / "alone")
    names = alone.train_seeds(both(store, alone.out), SEEDS)
    assert names == {
        model: [f"{model}-form-seed-3", f"{model}-form-seed-4"]
        for model in ("in", "sain")
    }
    assert bars_alone.told["Training SAIN-FORM-SEED-4"] == [20, 20]
    with worker_pool(2, core_each=True) as trainers:
        at_once, bars = chain_of(tmp_path / "at-once", trainers)
        assert at_once.train_seeds(both(store, at_once.out), SEEDS) == names
    assert bars.told == {"Training 4 networks": [80, 80]}
    for model, folders in names.items():
        for seed, name in zip(SEEDS, folders, strict=True):
            card = read_card(at_once.out / name)
            assert (card.identity.kind, card.config["seed"]) == (model, seed)
            one, two = (read_log(chain.out / name) for chain in (alone, at_once))
            assert [line["iteration"] for line in two] == [5, 10, 15, 20]
            losses = [[line["loss"] for line in lines] for lines in (one, two)]
            np.testing.assert_allclose(*losses, rtol=1e-3)
    # Finished and single training runs need no process.
    again, bars = chain_of(at_once.out, Broken())
    assert again.train_seeds(both(store, again.out), SEEDS) == names
    assert list(bars.told.values()) == [[20, 20]] * 4
    again.train_seeds({"in": both(store, again.out)["in"]}, (*SEEDS, 5))
    assert bars.told["Training IN-FORM-SEED-5"] == [20, 20]


def test_fine_tuning_starts_from_the_network_of_the_same_seed(store, tmp_path):
    recipe = CONFIG.changed(start=FromModel("some/in"))
    training = replace(both(store, tmp_path)["in"], recipe=recipe)
    starts = [one.recipe.start for one in training.of_seeds(SEEDS)]
    assert starts == [FromModel("some/in-seed-3"), FromModel("some/in-seed-4")]


def test_a_failed_training_run_is_reported_unchanged(store, tmp_path):
    trainings = both(store, tmp_path)["in"].of_seeds(SEEDS)
    (tmp_path / "in-form-seed-4").mkdir()
    (tmp_path / "in-form-seed-4" / "config.json").write_text("{}")
    with pytest.raises(RunConflict, match="in-form-seed-4"), worker_pool(2) as trainers:
        train_at_once(trainings, trainers, lambda done, note: None)


@pytest.mark.parametrize("processes", [Broken(), Gone()])
def test_a_killed_training_process_is_reported(store, tmp_path, processes):
    trainings = both(store, tmp_path)["in"].of_seeds(SEEDS)
    with pytest.raises(SainetError, match="memory ran out"):
        train_at_once(trainings, processes, lambda done, note: None)
