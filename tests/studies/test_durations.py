"""Durations of steps: what is kept, what is expected, and what is left."""

from collections import Counter

import pytest

from sainet.control.config import ControlConfig
from sainet.datasets.config import GenerateConfig
from sainet.evaluation.measurements import Condition
from sainet.runs.errors import BadInput
from sainet.studies import STUDIES, any_number, durations, effort, load_study
from sainet.studies.durations import DURATIONS, Clock, Duration, in_words
from sainet.studies.effort import Effort, Rate, Rates, expected_seconds, measured_rates
from sainet.studies.lab_pushes import Collect
from sainet.studies.paper_setup import physics
from sainet.studies.runner import Runner, all_steps
from sainet.studies.shares import unfinished
from sainet.studies.simulated_control import RunTrials
from sainet.studies.steps import First, Simulate, Step, Train
from sainet.studies.study import Scope, last_steps


class Wait(Step[str]):
    """Takes its time."""

    label: str
    seconds: float = 0.0
    parts: tuple[Step, ...] = ()

    @property
    def name(self):
        return self.label

    def run(self, runner):
        NOW[0] += self.seconds
        return self.label


NOW = [0.0]


@pytest.fixture(autouse=True)
def clock_of_steps(monkeypatch):
    """Time passes only in steps."""
    monkeypatch.setattr(durations, "perf_counter", lambda: NOW[0])


def worked(clock, step, seconds):
    with clock.time(step):
        NOW[0] += seconds


def test_steps_at_once_share_the_time(tmp_path):
    one, two = Wait("one"), Wait("two")
    clock = Clock(tmp_path)
    clock.begin(one)
    NOW[0] += 3
    clock.begin(two)
    NOW[0] += 8
    clock.end(one)
    NOW[0] += 1
    clock.end(two)
    assert clock.duration(one) == Duration(7, has_ended=True)
    assert clock.duration(two) == Duration(5, has_ended=True)


def test_an_interrupted_step_adds_up_and_a_finished_one_stays(tmp_path):
    step = Wait("one")
    with pytest.raises(KeyboardInterrupt), Clock(tmp_path).time(step):
        NOW[0] += 5
        raise KeyboardInterrupt
    assert Clock(tmp_path).duration(step) == Duration(5, has_ended=False)
    worked(Clock(tmp_path), step, 3)
    worked(Clock(tmp_path), step, 1)  # nothing was left to do
    assert Clock(tmp_path).duration(step) == Duration(8, has_ended=True)


def test_what_takes_no_time_leaves_no_file(tmp_path):
    worked(Clock(tmp_path), Wait("one"), 0.01)
    assert not list(tmp_path.rglob("*.json"))


def test_a_clock_without_a_folder_keeps_nothing():
    clock = Clock()
    worked(clock, Wait("one"), 3)
    assert clock.duration(Wait("one")) is None


def test_the_remaining_time_follows_the_pace_of_this_machine(tmp_path):
    steps = [Wait(str(n)) for n in range(3)]
    clock = Clock(tmp_path, {step.key: 600.0 for step in steps})
    assert clock.remaining() == 1800
    clock.begin(steps[0])
    NOW[0] += 300
    assert clock.remaining() == 1500
    NOW[0] += 900  # twice as slow
    assert clock.remaining() == 1200  # what takes too long may end at any moment
    clock.end(steps[0])
    assert clock.remaining() == pytest.approx(1200 * (1200 + 60) / (600 + 60))


def test_a_runner_times_every_step_and_tells_what_is_left(tmp_path):
    first = Wait("first", 40.0)
    last = Wait("last", 2.0, (first,))
    events = []
    clock = Clock(tmp_path, {first.key: 20.0, last.key: 30.0})
    runner = Runner(tmp_path, report=events.append, clock=clock)
    with runner.bar("before", 10) as bar:
        bar.add(5)
    runner.result(last)
    took = [runner.clock.duration(step).seconds for step in (first, last)]
    assert took == pytest.approx([40, 2])
    assert [event.left for event in events[:2]] == [50, 50]
    assert runner.clock.remaining() == 0


def test_a_damaged_duration_is_named(tmp_path):
    step = Wait("one")
    worked(Clock(tmp_path), step, 3)
    (path,) = (tmp_path / DURATIONS).iterdir()
    path.write_text('{"seconds": "long"}')
    with pytest.raises(BadInput, match=f"{path.name}.*only this duration is lost"):
        Clock(tmp_path).duration(step)


def test_only_finished_steps_with_a_folder_are_not_left(tmp_path):
    pushes = Simulate("train", GenerateConfig(pushes=10))
    half, started = First(pushes, 5), Simulate("test", pushes.config)
    steps = [pushes, half, started]
    clock = Clock(tmp_path)
    worked(clock, pushes, 4)
    worked(clock, half, 4)
    for step in steps:
        (tmp_path / step.folder_name).mkdir(parents=True)
    with pytest.raises(KeyboardInterrupt), clock.time(started):
        NOW[0] += 4
        raise KeyboardInterrupt
    assert unfinished(steps, tmp_path) == [half, started]
    (tmp_path / pushes.folder_name).rmdir()  # as we advise where a file is damaged
    assert unfinished(steps, tmp_path) == steps


@pytest.mark.parametrize(
    ("seconds", "words"),
    [
        *((0, "less than a minute"), (59.9, "less than a minute"), (61, "about 1 min")),
        *(
            (3570, "about 60 min"),
            (3601, "about 1 h 0 min"),
            (8000, "about 2 h 13 min"),
        ),
    ],
)
def test_durations_in_words(seconds, words):
    assert in_words(seconds) == words


def steps_of(scale):
    """The steps of all studies without recorded pushes."""
    studies = [load_study(name) for name in STUDIES]
    here = [s for s in studies if Scope.recorded_pushes not in s.needs]
    return list(all_steps(last_steps(s.plan(Scope(scale)) for s in here)).values())


@pytest.mark.parametrize("scale", ["quick", "paper"])
def test_every_dataset_training_run_and_trial_has_a_measured_rate(scale):
    rates = measured_rates()
    slow = (Simulate, Train, RunTrials, Collect)
    kinds = {effort.effort(s).kind for s in steps_of(scale) if isinstance(s, slow)}
    assert kinds <= rates.kinds.keys()
    assert rates.processor and rates.cores


def test_expected_seconds_grow_with_the_work_and_shrink_with_cores(monkeypatch):
    rates = Rates(processor="", cores=4, kinds={"Simulate planar": Rate(1.0, 0.5)})
    monkeypatch.setattr(effort, "measured_rates", lambda: rates)
    steps = [
        Simulate("s", GenerateConfig(pushes=n, disks=d)) for n, d in ((10, 2), (30, 3))
    ]
    for cores, times in ((4, 1), (8, 0.5)):
        monkeypatch.setattr(effort, "core_count", lambda cores=cores: cores)
        found = list(expected_seconds(steps).values())
        # A push is simulated once for the truth and once for each assumed engine.
        assert found == [(1 + 0.5 * size) * times for size in (10 * 2 * 2, 30 * 2 * 3)]


def test_contact_networks_have_rates_of_their_own_and_mixtures_all_their_disks():
    scope = Scope("paper")
    (held,), (often,) = (
        {effort.effort(each) for each in any_number.of_two(scope, *settings)}
        for settings in ((), (any_number.ASSUMED, any_number.FOR_ASSUMED))
    )
    assert (held.kind, often.kind) == (
        "Train whole-push, held",
        "Train whole-push, contact",
    )
    (mixed,) = {effort.effort(each) for each in any_number.of_one_to_four(scope)}
    assert mixed == Effort(held.kind, held.size * 2.5 / 2)


@pytest.mark.parametrize(
    ("changes", "size"),
    [
        ({"pushes": 2}, 2 * 5 * 2 * 4),
        ({"pushes": 60}, 2 * 5 * 20 * 4),  # no episode has as many as it may have
        ({"pushes": 2, "disks": 3}, 2 * 5 * 2 * 9),
    ],
)
def test_trials_take_longer_with_more_models_pushes_and_disks(changes, size):
    config = ControlConfig(trials=5, **changes)
    trials = RunTrials(physics(), config, Condition(label="some"))
    assert effort.effort(trials) == Effort("RunTrials greedy", size)


def test_the_paper_takes_longer_than_the_quick_scale():
    quick, paper = (
        sum(expected_seconds(steps_of(s)).values()) for s in ("quick", "paper")
    )
    assert paper > 20 * quick > 0


def networks(scope):
    """The training runs of Table III, by their keys."""
    plan = load_study("robot-two-disks").plan(scope)
    return {k: s for k, s in all_steps([plan.measured]).items() if isinstance(s, Train)}


@pytest.mark.parametrize(
    ("scope", "runs"),
    [
        (Scope("paper"), 5),
        (Scope("paper", None, 2), 2),
        (Scope("paper", None, 9), 5),
        (Scope("quick", None, 2), 1),
    ],
)
def test_each_network_has_at_most_so_many_training_runs(scope, runs):
    found = Counter(step.id.slug for step in networks(scope).values())
    assert set(found.values()) == {runs}


def test_fewer_training_runs_are_some_of_all():
    assert networks(Scope("paper", None, 1)).keys() < networks(Scope("paper")).keys()
    assert list(Scope("paper", None, 2).seeds(5, first=3)) == [3, 4]
