"""`sainet evaluate` in a run folder: each model once, by whichever shard."""

import json
import pickle
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager

import pytest
from safetensors import safe_open
from safetensors.numpy import load_file, save_file

from learning.stores import quiet_store
from sainet.cli.entry import run
from sainet.runs.executors import Machines

MODELS = ("physics", "physics-true")


@pytest.fixture(scope="module")
def words(tmp_path_factory):
    data = quiet_store(tmp_path_factory.getbasetemp()).path
    quiet = ["--steps", "5", "--json", "--quiet"]
    return ["evaluate", "--model", *MODELS, "--data", str(data), *quiet]


@pytest.fixture
def printed(words, capsys):
    assert run(words) == 0
    return json.loads(capsys.readouterr().out)


def files(out):
    return sorted(out.glob("errors-*.safetensors"))


def test_shards_give_the_same_table(words, printed, tmp_path, capsys):
    there = [*words, "--out", str(tmp_path)]
    for number in (2, 1, 3):
        assert run([*there, "--shard", f"{number}/3"]) == 0
        assert json.loads(capsys.readouterr().out)["models"] == (number < 3)
    assert len(files(tmp_path)) == 2
    assert run(there) == 0
    assert json.loads(capsys.readouterr().out) == printed
    assert not (tmp_path / "shards").exists()
    before = [path.stat().st_mtime_ns for path in files(tmp_path)]
    assert run(there) == 0
    assert json.loads(capsys.readouterr().out) == printed
    assert [path.stat().st_mtime_ns for path in files(tmp_path)] == before


@contextmanager
def threads(machines, workers=None):
    """In the place of a scheduler; its jobs travel as to other processes."""

    class Pickling(ThreadPoolExecutor):
        def submit(self, work, *arguments):
            return super().submit(*pickle.loads(pickle.dumps((work, *arguments))))

    with Pickling(2) as executor:
        yield executor


def test_workers_of_a_scheduler_give_the_same_table(
    words, printed, tmp_path, capsys, monkeypatch
):
    monkeypatch.setattr(Machines, "executor", threads)
    there = [*words, "--scheduler", "tcp://nowhere"]
    assert run(there) == 2
    assert "--out is missing" in capsys.readouterr().err
    there += ["--out", str(tmp_path)]
    assert run([*there, "--shard", "1/2"]) == 2
    assert "--scheduler is tcp://nowhere" in capsys.readouterr().err
    assert run(there) == 0
    assert json.loads(capsys.readouterr().out) == printed
    assert len(files(tmp_path)) == 2
    assert not (tmp_path / "shards").exists()


def test_bad_shards_end_in_one_line(words, tmp_path, capsys):
    there = [*words, "--out", str(tmp_path)]
    assert run([*there, "--shard", "1/2"]) == 0
    capsys.readouterr()
    cases = [
        ([*words, "--shard", "1/2"], "--out is missing; give the folder"),
        ([*there, "--shard", "2/2", "--steps", "6"], "steps is 5, not 6"),
        ([*there, "--shard", "1/2", "--table", "a.md"], "--table is a.md; it must be"),
        ([*there, "--shard", "1/2", "--page", "a.html"], "--page is a.html; it must"),
        ([*there, "--shard", "2"], "--shard is 2; it must be a number and a count"),
    ]
    for bad, message in cases:
        assert run(bad) == 2
        error = capsys.readouterr().err
        assert message in error
        assert error.count("\n") == 1
    (file,) = files(tmp_path)
    file.write_bytes(b"x")
    assert run(there) == 2
    assert ".safetensors: truncated" in capsys.readouterr().err


def test_a_damaged_part_is_named(words, tmp_path, capsys):
    there = [*words, "--out", str(tmp_path)]
    assert run(there) == 0
    files(tmp_path)[0].write_bytes(b"x")
    capsys.readouterr()
    assert run(there) == 2
    assert "delete it, then run the same command again" in capsys.readouterr().err


@pytest.mark.parametrize("keeps_seal", [True, False])
def test_an_edited_part_is_refused(words, tmp_path, capsys, keeps_seal):
    there = [*words, "--out", str(tmp_path)]
    assert run(there) == 0
    path = files(tmp_path)[0]
    with safe_open(path, "numpy") as file:
        metadata = file.metadata() if keeps_seal else None
    smaller = {name: 0.1 * values for name, values in load_file(path).items()}
    save_file(smaller, path, metadata)
    capsys.readouterr()
    assert run(there) == 2
    error = capsys.readouterr().err
    assert f"{path}: seal: " in error
    assert "Delete it, then run the same command again" in error
    assert error.count("\n") == 1
