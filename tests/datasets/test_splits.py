"""Train and test parts of a dataset: what stays together, and `sainet split`."""

import json
import os
import subprocess
import sys
import time

import numpy as np
import pytest

from datasets.stores import assert_same_files
from learning.stores import end_points_alone, info_of, made_up, write
from sainet.cli.entry import run
from sainet.datasets.chains import continuations, linked
from sainet.datasets.splits import (
    fold_of_push,
    split,
    split_rows,
    write_split,
)
from sainet.datasets.store import open_store
from sainet.runs.errors import BadInput, RunConflict
from support import SOURCE

REPEATS = np.repeat(np.arange(10), 3)


@pytest.fixture
def store(tmp_path):
    info = info_of(30, has_repeats=True)
    return write(tmp_path / "data", info, made_up(info) | {"repeat": REPEATS})


@pytest.mark.parametrize(("test", "tested"), [(0.2, 6), (0.5, 15), (0.01, 3)])
def test_parts_share_no_push_and_no_repeat(store, test, tested):
    train, tests = split(store, test, seed=1)
    assert (train.info.pushes, tests.info.pushes) == (30 - tested, tested)
    assert sorted((*train.rows, *tests.rows)) == list(range(30))
    assert not set(train.repeats()) & set(tests.repeats())


def test_a_push_that_is_stored_twice_stays_in_one_part(tmp_path):
    info = info_of(3)
    twice = write(tmp_path / "data", info, made_up(info)).take([0, 1, 2, 1, 0])
    for seed in range(20):
        train, tests = split(twice, 0.4, seed)
        assert not set(train.push_hashes()) & set(tests.push_hashes())


def test_copies_make_repeats_of_what_they_are_repeats_of(tmp_path):
    info = info_of(6, has_repeats=True)
    arrays = made_up(info)
    copied = {
        name: np.asarray(each)[[0, 1, 2, 3, 0, 5]] for name, each in arrays.items()
    }
    kinds = np.array([7, 7, 2, 4, 4, 1])  # push 4, a copy of push 0, is a repeat of 3
    store = write(tmp_path / "data", info, copied | {"repeat": kinds})
    assert store.repeats().tolist() == [7, 7, 2, 7, 7, 1]


def test_a_seed_determines_the_parts(store):
    rows = {split(store, seed=seed)[1].rows for seed in range(10)}
    assert len(rows) > 5
    assert split(store, seed=3)[1].rows == split(store, seed=3)[1].rows


def test_the_draw_is_that_of_earlier_versions():
    """Validation pushes and folds of trained networks must not change."""
    train, tests = split_rows(REPEATS, 0.2, 0)
    assert tests.tolist() == [12, 13, 14, 6, 7, 8]
    assert train.tolist()[:6] == [18, 19, 20, 9, 10, 11]
    assert fold_of_push(np.arange(10), 4).tolist() == [0, 0, 3, 1, 1, 3, 0, 1, 2, 2]


def test_pushes_that_are_all_repeats_cannot_be_split(tmp_path):
    info = info_of(4, has_repeats=True)
    store = write(tmp_path / "data", info, made_up(info) | {"repeat": np.zeros(4)})
    with pytest.raises(BadInput, match="all pushes are repeats"):
        split(store)


def test_a_chain_of_pushes_stays_together(tmp_path):
    """Push k starts where push k - 1 ended, but for pushes 5 and 9."""
    info = info_of(12, engine="recorded", seed=None, has_repeats=True)
    arrays = made_up(info)
    for push in range(1, 12):
        start = arrays["truth"][push - 1, -1, :, :3].copy()
        start[..., 2] += 2 * np.pi  # the same angle
        start[0, 0] += {5: 4e-4, 9: 0.0}.get(push, 2e-4)
        start[1, 2] += {9: 0.02}.get(push, 0.01)
        arrays["truth"][push, ..., :3] += start - arrays["initial"][push, :, :3]
        arrays["initial"][push, :, :3] = start
    arrays = end_points_alone(arrays) | {"repeat": np.arange(12)}
    chains = [[0, 1, 2, 3, 4], [5, 6, 7, 8], [9, 10, 11]]
    store = write(tmp_path / "data", info, arrays)
    numbers = linked(store)
    found = [np.flatnonzero(numbers == n).tolist() for n in dict.fromkeys(numbers)]
    assert found == chains
    train, tests = split(store, 0.3, chains=True)
    assert sorted([*train.rows, *tests.rows]) == list(range(12))
    assert list(tests.rows) in chains
    parts = write_split(store, tmp_path / "parts", test=0.3, chains=True)
    assert [part.info.pushes for part in parts] == [len(train.rows), len(tests.rows)]
    for found, part in zip(parts, (train, tests), strict=True):
        assert (found.push_hashes() == part.push_hashes()).all()
    # Repeats join the chains that they are in.
    again = write(tmp_path / "again", info, arrays | {"repeat": np.arange(12) % 11})
    numbers = linked(again)
    assert numbers[0] == numbers[11]
    assert len(set(numbers)) == 2


def test_continuations_are_those_of_a_double_loop():
    """Of poses about as near as counts, on both sides and at all angles."""
    rng, count = np.random.default_rng(0), 60
    start = rng.uniform(-1, 1, (count, 2, 3)) * [0.5, 0.5, np.pi]
    away = rng.uniform(-1, 1, (count, 2, 3)) * [2.5e-4, 2.5e-4, np.deg2rad(1.2)]
    end = (start + away)[::-1]
    end[3] = np.nan
    ended, started = continuations(start, end)
    wanted = set()
    for one in range(count):
        for other in range(count):
            x, y, angle = (start[other] - end[one]).T
            turned = np.abs(np.angle(np.exp(1j * angle)))
            if (np.hypot(x, y) <= 3e-4).all() and (turned <= np.deg2rad(1.0)).all():
                wanted.add((one, other))
    assert {*zip(ended.tolist(), started.tolist(), strict=True)} == wanted
    assert 10 < len(wanted) < 50


def test_parts_become_datasets_like_any_other(store, tmp_path):
    train, tests = write_split(store, tmp_path / "out", test=0.4, seed=2)
    parts = split(store, 0.4, 2)
    for found, part, name in zip((train, tests), parts, ("train", "test"), strict=True):
        assert found.path == tmp_path / "out" / name
        for key, array in open_store(found.path).read(slice(None)).items():
            np.testing.assert_array_equal(array, part.read(slice(None))[key])
    again = write_split(store, tmp_path / "out", test=0.4, seed=2)
    assert again[0].content == train.content
    with pytest.raises(RunConflict, match="seed is 2"):
        write_split(store, tmp_path / "out", test=0.4, seed=3)
    with pytest.raises(RunConflict, match="train: holds another run"):
        write_split(store, train.path)
    assert not (train.path / "train").exists()


@pytest.mark.parametrize(
    ("change", "wanted"),
    [({"test": 0.0}, "test"), ({"test": 1.5}, "test"), ({"seed": -1}, "seed")],
)
def test_settings_out_of_range_are_refused(store, tmp_path, change, wanted):
    with pytest.raises(BadInput, match=f"{wanted}.? is"):
        write_split(store, tmp_path / "out", **change)
    assert not (tmp_path / "out").exists()


def test_a_killed_split_resumes(store, tmp_path):
    write_split(store, tmp_path / "whole")
    out = tmp_path / "killed"
    words = ["split", "--data", str(store.path), "--out", str(out)]
    command = [sys.executable, "-m", "sainet", *words]
    environment = os.environ | {"PYTHONPATH": str(SOURCE.parent)}
    killed = subprocess.Popen(command, env=environment)
    while killed.poll() is None and not list(out.rglob("chunk-*.json")):
        time.sleep(0.001)
    killed.kill()
    killed.wait()
    assert run([*words, "--quiet"]) == 0
    assert_same_files(out, tmp_path / "whole")


def test_a_folder_of_datasets_names_them(store, tmp_path, capfd):
    """An earlier message called the folder an unfinished dataset."""
    out = tmp_path / "parts"
    write_split(store, out, test=0.2, seed=3)
    assert run(["inspect", str(out)]) == 2
    wanted = f"sainet: {out}: not a dataset; give {out}/test or {out}/train.\n"
    assert capfd.readouterr().err == wanted


def test_the_command_prints_the_sizes(store, tmp_path, capfd):
    words = ["split", "--data", str(store.path), "--out", str(tmp_path / "out")]
    assert run([*words, "--test", "0.1", "--json"]) == 0
    found = json.loads(capfd.readouterr().out.splitlines()[-1])
    assert (found["train"], found["test"]) == (27, 3)
    assert run([*words, "--test", "1"]) == 2
    assert len(capfd.readouterr().err.splitlines()) == 1
