"""Steps divided among shards: which belong together, what waits, what is collected."""

import importlib
import inspect
import pkgutil

import pytest

from sainet import studies
from sainet.runs.errors import BadInput
from sainet.runs.shards import SHARDS, Shard
from sainet.studies.runner import Runner
from sainet.studies.shares import (
    collected,
    divided,
    kept_steps,
    run_share,
)
from sainet.studies.simulated_control import RunTrials
from sainet.studies.steps import Step
from sainet.studies.study import Plan, last_steps

SETTINGS = {"command": "test"}


class Data(Step[str]):
    """Kept like a dataset: what it needs may belong to another shard."""

    is_kept = True

    label: str
    parts: tuple[Step, ...] = ()

    def run(self, runner):
        folder = runner.folder(self)
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "note").write_text(self.label)
        return self.label


class Note(Data):
    """The work of a fold."""

    @property
    def stays_with_inputs(self):
        return bool(self.parts)


class Memory(Step[str]):
    """Not kept."""

    parts: tuple[Step, ...] = ()

    def run(self, runner):
        return "".join(runner.result(part) for part in self.parts)


def every_step():
    """All classes of steps of all studies."""
    for module in pkgutil.iter_modules(studies.__path__, "sainet.studies."):
        importlib.import_module(module.name)
    waiting = [Step]
    while waiting:
        kind = waiting.pop()
        waiting += kind.__subclasses__()
        if kind.__module__.startswith("sainet."):
            yield kind


def test_every_step_with_a_run_folder_is_divided():
    kinds = list(every_step())
    assert RunTrials in kinds
    # `run` of a step with a folder of its own asks for this folder.
    writers = [k for k in kinds if "runner.folder(self)" in inspect.getsource(k)]
    assert [kind for kind in writers if not kind.is_kept] == []


def folds(count):
    """Folds in which one step needs the other, and what joins them."""
    return Memory(
        tuple(Note("test", (Note("fit", (Note(f"{n}"),)),)) for n in range(count))
    )


def test_a_fold_belongs_to_one_shard():
    steps = kept_steps([folds(3)])
    assert len(steps) == 9
    one, two = (divided(steps, Shard(number, 2)) for number in (1, 2))
    assert [len(one), len(two)] == [6, 3]
    assert {step.key for step in (*one, *two)} == steps.keys()
    own = {step.key for step in one}
    assert all({each.key for each in step.inputs} <= own for step in one)


def test_the_steps_of_a_plan_are_counted_once():
    measured, other = folds(2), folds(1)
    lasts = list(last_steps([Plan(measured), Plan(other, as_trained=measured)]))
    assert len(lasts) == 3
    assert len(kept_steps(lasts)) == 6


def share(out, last, number, count=2):
    runner = Runner(out / "steps")
    return run_share([last], out, SETTINGS, Shard(number, count), runner)


def test_a_shard_does_what_it_can_and_goes_on_later(tmp_path):
    first = Data("first")
    last = Memory((Data("second", (Memory((first,)),)), Data("third", (first,))))
    steps = list(kept_steps([last]).values())
    assert [step.label for step in steps] == ["first", "second", "third"]
    early = share(tmp_path, last, 2)
    assert (early.done, early.waiting) == (0, 1)
    assert "finished 0 of its 1 steps; the others need" in early.in_words(Shard(2, 2))
    done = share(tmp_path, last, 1)
    assert (done.done, done.waiting) == (2, 0)
    assert done.in_words(Shard(1, 2)) == "Shard 1/2 has finished its 2 steps."
    late = share(tmp_path, last, 2)
    assert (late.done, late.waiting) == (1, 0)
    notes = sorted(path.read_text() for path in tmp_path.glob("steps/*/note"))
    assert notes == ["first", "second", "third"]


def test_collecting_counts_what_shards_did(tmp_path, caplog):
    last = folds(3)
    share(tmp_path, last, 2)
    with collected([last], tmp_path, SETTINGS):
        runner = Runner(tmp_path / "steps")
        assert runner.result(last) == "testtesttest"
    assert "6 of 9 pieces are missing from 1 shards" in caplog.text
    assert not (tmp_path / SHARDS).exists()
    with collected([last], tmp_path, SETTINGS):  # without shards
        pass


def test_a_refused_step_keeps_the_lists_of_shards(tmp_path):
    share(tmp_path, folds(2), 1)
    with (
        pytest.raises(BadInput, match="edited"),
        collected([folds(2)], tmp_path, SETTINGS),
    ):
        raise BadInput("the file was edited")
    assert (tmp_path / SHARDS).exists()
