"""The runner: order, resumption, and steps at once."""

import threading
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from functools import partial

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
from sainet.studies.steps import Apart, Given, Place, Step, Train

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

    is_kept = True

    label: str
    parts: tuple[Step, ...] = ()

    @property
    def name(self):
        return self.label

    def run(self, runner):
        folder = runner.folder(self)
        if not (folder / "note").exists():
            folder.mkdir(parents=True)
            (folder / "note").write_text(threading.current_thread().name)
        return (folder / "note").read_text()


class Who(Apart[str]):
    """Names the thread that ran it, and keeps nothing."""

    label: str

    @property
    def name(self):
        return self.label

    def run(self, runner):
        return threading.current_thread().name


class Spread(Step[list[str]]):
    """Uses the executor of the runner; names the thread that asked it to."""

    parts: tuple[Step, ...]

    @property
    def place(self):
        return Place.SPREAD

    def run(self, runner):
        return [threading.current_thread().name, *map(runner.result, self.parts)]


class Names(Step[list[str]]):
    """Who ran each part."""

    parts: tuple[Step, ...]

    def run(self, runner):
        return [runner.result(part) for part in self.parts]


class Fails(Apart[None]):
    """Does not work."""

    def run(self, runner):
        raise SainetError("it does not work")


@pytest.fixture
def executor():
    with ThreadPoolExecutor(2, "worker") as found:
        yield found


def test_steps_apart_run_in_other_processes(tmp_path, executor):
    names = Names((Note("a"), Who("b"), Note("c", (Note("d"),))))
    found = Runner(tmp_path, executor, at_once=2).result(names)
    assert all("worker" in name for name in found)
    for one in (Runner(tmp_path / "one", executor), Runner(tmp_path / "two")):
        assert one.result(names) == ["MainThread"] * 3


def test_a_step_in_pieces_runs_here_after_its_inputs(tmp_path, executor):
    spread = Spread((Note("a"), Who("b")))
    found = Runner(tmp_path, executor, at_once=2).result(Names((spread, Note("c"))))
    assert found[0][0] == "MainThread"
    assert all("worker" in name for name in (*found[0][1:], found[1]))


class Listed(ThreadPoolExecutor):
    """Runs jobs one after another, and lists their steps."""

    def __init__(self):
        super().__init__(1, "worker")
        self.order = []

    def submit(self, fn, step, out):
        self.order.append(step.name)
        future = super().submit(fn, step, out)
        future.exception()
        return future


def test_steps_ahead_run_beside_those_that_are_needed(tmp_path):
    needed, ahead = Names((Note("a"),)), Names((Who("x"), Note("y"), Who("z")))
    with Listed() as executor:
        runner = Runner(tmp_path, executor, at_once=2, ahead=[needed, ahead])
        runner.result(needed)
        assert executor.order[:2] == ["a", "x"]
        runner.result(ahead)
        assert sorted(executor.order) == ["a", "x", "y", "z"]


class Held(Executor):
    """Has jobs, of which none ends until all are released."""

    def __init__(self):
        self.jobs = []

    def submit(self, fn, /, *args, **kwargs):
        future = Future()
        self.jobs.append((future, partial(fn, *args)))
        assert len(self.jobs) <= 2
        if len(self.jobs) == 2:
            self.release()
        return future

    def release(self):
        for future, job in self.jobs:
            future.set_result(job())
        self.jobs = []


def test_the_executor_has_at_most_so_many_steps_at_once(tmp_path):
    names = Names(tuple(Who(f"{n}") for n in range(4)))
    found = Runner(tmp_path, Held(), at_once=2).result(names)
    assert found == ["MainThread"] * 4


def test_progress_counts_steps_and_names_those_that_run(tmp_path):
    events = []
    names = Names(tuple(Who(f"{n}") for n in range(4)))
    Runner(tmp_path, Held(), events.append, at_once=2).result(names)
    assert {(event.title, event.total) for event in events} == {("0 and 3 more", 4)}
    assert [event.done for event in events][::2] == [0, 4]
    assert events[1].note == "2, 3"
    assert events[-1].has_ended


def test_a_failed_step_is_reported_and_the_others_are_given_up(tmp_path):
    last = Names((Fails(), Note("a")))
    with Listed() as executor, pytest.raises(SainetError, match="does not work"):
        Runner(tmp_path, executor, at_once=2).result(last)


def test_the_error_of_a_step_ahead_is_raised_when_it_is_needed(tmp_path):
    first, second = Names((Note("a"), Who("b"))), Names((Fails(), Who("c")))
    with Listed() as executor:
        runner = Runner(tmp_path, executor, at_once=3, ahead=[first, second])
        assert len(runner.result(first)) == 2
        assert "fails" in executor.order
        with pytest.raises(SainetError, match="does not work"):
            runner.result(second)


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


@pytest.mark.slow
def test_networks_trained_at_once_are_the_same(store, tmp_path):
    told = {}

    def report(event):
        told[event.title] = (event.total, event.done, event.has_ended)

    alone, step = Runner(tmp_path / "alone", report=report), networks(store)
    assert [model.id for model in alone.result(step)] == [IN, IN, SAIN, SAIN]
    assert told["Training sain-seed-4"] == (20, 20, True)
    with worker_pool(2, core_each=True) as executor:
        at_once = Runner(tmp_path / "at-once", executor, at_once=3)
        at_once.result(step)
    for each in step.networks:
        card = read_card(at_once.folder(each))
        known = card.identity.kind, card.recipe.seed
        assert known == (each.id.kind, each.recipe.seed)
        one, two = (read_log(run.folder(each)) for run in (alone, at_once))
        assert [line.iteration for line in two] == [5, 10, 15, 20]
        losses = [[line.loss for line in lines] for lines in (one, two)]
        np.testing.assert_allclose(*losses, rtol=1e-3)


def test_fine_tuning_starts_from_the_network_of_the_same_seed(store, tmp_path):
    runner = Runner(tmp_path)
    first = Train(IN, Given(store), CONFIG.changed(seed=3))
    second = Train(IN, Given(store), CONFIG.changed(seed=3), start=first)
    assert list(second.inputs)[1:] == [first]
    recipe = second.recipe_in(runner)
    assert recipe.start.model == str(runner.folder(first)) != str(runner.folder(second))


def test_a_failed_training_run_is_reported_unchanged(store, tmp_path):
    step = networks(store)
    with worker_pool(1) as executor:
        runner = Runner(tmp_path, executor, at_once=1)
        folder = runner.folder(step.networks[0])
        folder.mkdir()
        (folder / "config.json").write_text("{}")
        with pytest.raises(RunConflict, match="in-seed-3"):
            runner.result(step)


@pytest.mark.parametrize("processes", [Broken(), Gone()])
def test_a_killed_training_process_is_reported(store, tmp_path, processes):
    with pytest.raises(SainetError, match="memory ran out"):
        Runner(tmp_path, processes, at_once=2).result(networks(store))
