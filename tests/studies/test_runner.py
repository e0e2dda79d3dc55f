"""The runner: order, resumption, and networks trained at once."""

import threading
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool

import numpy as np
import pytest

from learning.stores import quiet_store
from sainet.learning.log import read_log
from sainet.learning.recipes import PAPER
from sainet.models.card import read_card
from sainet.runs.errors import RunConflict, SainetError
from sainet.runs.workers import worker_pool
from sainet.studies.paper_setup import IN, SAIN
from sainet.studies.runner import Runner
from sainet.studies.steps import Apart, Given, Step, Train

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


class Sum(Step[int]):
    """Adds one to the sum of its inputs, and lists what it did."""

    label: str
    log: list[str]
    parts: tuple["Sum", ...] = ()

    @property
    def name(self):
        return self.label

    def run(self, runner):
        self.log.append(self.label)
        return 1 + sum(map(runner.result, self.parts))


class Note(Apart[str]):
    """Writes a file in its folder, and names the thread that did so."""

    label: str

    def work(self, folder):
        if not (folder / "note").exists():
            folder.mkdir(parents=True)
            (folder / "note").write_text(threading.current_thread().name)

    def run(self, runner):
        self.work(runner.folder(self))
        return (runner.folder(self) / "note").read_text()


class Notes(Step[list[str]]):
    """Who wrote each note."""

    parts: tuple[Note, ...]

    def run(self, runner):
        return [runner.result(part) for part in self.parts]


def test_work_apart_is_done_by_the_executor_where_there_are_several(tmp_path):
    several, one = Notes((Note("a"), Note("b"))), Notes((Note("c"),))
    with ThreadPoolExecutor(2, "worker") as executor:
        runner = Runner(tmp_path, executor)
        assert all("worker" in name for name in runner.result(several))
        assert runner.result(one) == ["MainThread"]
    assert Runner(tmp_path).result(Notes((Note("d"), Note("e")))) == ["MainThread"] * 2


def test_every_step_runs_once_after_its_inputs(tmp_path):
    log = []
    first = Sum("first", log)
    left, right = Sum("left", log, (first,)), Sum("right", log, (first,))
    last = Sum("last", log, (left, right, Sum("first", [])))
    runner = Runner(tmp_path)
    assert runner.result(last) == 6
    assert runner.result(last) == 6
    assert log[0] == "first"
    assert log[-1] == "last"
    assert sorted(log) == ["first", "last", "left", "right"]


def test_the_key_depends_on_type_settings_and_inputs(store):
    class Other(Sum):
        """Another step with the same fields."""

    one = Sum("a", [])
    keys = {one.key, Sum("b", []).key, Other("a", []).key, Sum("a", [], (one,)).key}
    assert len(keys) == 4
    assert Sum("a", []).key == one.key
    data = Given(store)
    keys = {
        Train(network, data, CONFIG.changed(seed=seed)).key
        for network in (IN, SAIN)
        for seed in SEEDS
    }
    assert len(keys) == 4
    assert Train(IN, data, CONFIG).key == Train(IN, Given(store), CONFIG).key
    assert Train(IN, Given(store.first(3)), CONFIG).key != Train(IN, data, CONFIG).key


class All(Step[list]):
    """The networks."""

    networks: tuple[Train, ...]

    @property
    def name(self):
        return "all"

    def run(self, runner):
        return [runner.result(each) for each in self.networks]


def networks(store, seeds=SEEDS):
    return All(
        tuple(
            Train(network, Given(store), CONFIG.changed(seed=seed))
            for network in (IN, SAIN)
            for seed in seeds
        )
    )


def runner_of(folder, trainers=None):
    """A runner, and its events by title: the total and what was done at last."""
    told = {}

    def report(event):
        told[event.title] = (event.total, event.done, event.has_ended)

    return Runner(folder, Broken(), report, trainers), told


@pytest.mark.slow
def test_parallel_training_gives_the_same_networks(store, tmp_path):
    alone, told_alone = runner_of(tmp_path / "alone")
    step = networks(store)
    assert [model.id for model in alone.result(step)] == [IN, IN, SAIN, SAIN]
    assert told_alone["Training sain-seed-4"] == (20, 20, True)
    with worker_pool(2, core_each=True) as trainers:
        at_once, told = runner_of(tmp_path / "at-once", trainers)
        at_once.result(step)
    assert told["Training 4 networks"] == (80, 80, True)
    for each in step.networks:
        card = read_card(at_once.folder(each))
        known = card.identity.kind, card.recipe.seed
        assert known == (each.id.kind, each.recipe.seed)
        one, two = (read_log(run.folder(each)) for run in (alone, at_once))
        assert [line.iteration for line in two] == [5, 10, 15, 20]
        losses = [[line.loss for line in lines] for lines in (one, two)]
        np.testing.assert_allclose(*losses, rtol=1e-3)
    # Finished and single training runs need no process.
    again, told = runner_of(at_once.out, Broken())
    again.result(step)
    assert list(told.values()) == [(20, 20, True)] * 4
    again.result(All((*step.networks, Train(IN, Given(store), CONFIG))))
    assert told["Training in-seed-0"] == (20, 20, True)


def test_fine_tuning_starts_from_the_network_of_the_same_seed(store, tmp_path):
    runner = Runner(tmp_path)
    first = Train(IN, Given(store), CONFIG.changed(seed=3))
    second = Train(IN, Given(store), CONFIG.changed(seed=3), start=first)
    assert list(second.inputs)[1:] == [first]
    runner._results[second.pushes.key] = store
    _, _, recipe, out = second.fitting(runner).args
    assert recipe.start.model == str(runner.folder(first)) != str(out)


def test_a_failed_training_run_is_reported_unchanged(store, tmp_path):
    step = networks(store)
    with worker_pool(1) as trainers:
        runner = Runner(tmp_path, trainers=trainers)
        folder = runner.folder(step.networks[0])
        folder.mkdir()
        (folder / "config.json").write_text("{}")
        with pytest.raises(RunConflict, match="in-seed-3"):
            runner.result(step)


@pytest.mark.parametrize("processes", [Broken(), Gone()])
def test_a_killed_training_process_is_reported(store, tmp_path, processes):
    with pytest.raises(SainetError, match="memory ran out"):
        Runner(tmp_path, trainers=processes).result(networks(store))
