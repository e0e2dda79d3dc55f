"""Generating: same settings, same bytes, whoever works and whatever interrupts."""

import errno
import itertools
import json
import multiprocessing
import shutil
import signal
import subprocess
import time
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from importlib.util import find_spec

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from datasets.stores import assert_same_files, contents, small, start_generating
from sainet.datasets import schema, writer
from sainet.datasets.config import GenerateConfig
from sainet.datasets.generate import generate
from sainet.datasets.store import open_store
from sainet.engines.planar.engine import PlanarEngine
from sainet.runs.documents import write_document
from sainet.runs.errors import BadInput, Diverged, MissingExtra, RunConflict
from support import require


@pytest.mark.slow
def test_any_number_of_workers_makes_the_same_bytes(whole_store, tmp_path):
    context = multiprocessing.get_context("spawn")
    for workers in (1, 2):
        with ProcessPoolExecutor(workers, mp_context=context) as executor:
            generate(small(), tmp_path / str(workers), executor=executor)
        assert_same_files(tmp_path / str(workers), whole_store)


@pytest.mark.slow
def test_killed_runs_resume_to_the_same_bytes(whole_store, tmp_path):
    """One run is killed twice; what kills at its start leave is tested below."""
    out = tmp_path / "store"
    for receipts in (1, 3):
        process = start_generating(out)
        wait_for(lambda n=receipts: _receipts(out) >= n and out.exists(), process)
        process.send_signal(signal.SIGKILL)
        process.communicate()
        assert not (out / schema.HASHES).exists()
    generate(small(), out)
    assert_same_files(out, whole_store)


def _receipts(out) -> int:
    return len(list((out / writer.PROGRESS).glob("chunk-*.json")))


def wait_for(condition, process, timeout=60):
    deadline = time.monotonic() + timeout
    while not condition():
        assert process.poll() is None, process.communicate()[1]
        assert time.monotonic() < deadline
        time.sleep(0.002)


# The writes: manifest, settings, receipts of six chunks, list of hashes.
@pytest.mark.parametrize("moment", range(9))
def test_killed_at_any_write_resumes_to_the_same_bytes(
    whole_store, tmp_path, monkeypatch, moment
):
    """What a kill leaves: the files so far, and a temporary one, half-written."""
    out = tmp_path / "store"
    _stop_at_write(monkeypatch, moment)
    with pytest.raises(_Killed):
        generate(small(), out)
    monkeypatch.undo()
    generate(small(), out)
    assert_same_files(out, whole_store)


class _Killed(BaseException):
    """Not an Exception: nothing tidies up after it."""


def _stop_at_write(monkeypatch, moment: int):
    """Stops at the given write of a JSON file or of a chunk, as SIGKILL would."""
    count = itertools.count()

    @contextmanager
    def atomic_path(path):
        temporary = path.with_name(f".{path.name}.0.partial")
        path.parent.mkdir(parents=True, exist_ok=True)
        if next(count) == moment:
            temporary.write_bytes(b"{")
            raise _Killed
        yield temporary
        temporary.replace(path)

    monkeypatch.setattr("sainet.runs.documents.atomic_path", atomic_path)


def test_killed_after_the_last_write_leaves_nothing_behind(whole_store, tmp_path):
    out = tmp_path / "store"
    shutil.copytree(whole_store, out)
    (out / writer.PROGRESS).mkdir()
    (out / writer.PROGRESS / "chunk-000000.json").write_text("{}")
    (out / ".hashes.json.0.partial").write_text("{")
    generate(small(), out)
    assert_same_files(out, whole_store)


def test_finished_runs_stay_unchanged(whole_store):
    before = {path: path.stat().st_mtime_ns for path in whole_store.rglob("*")}
    store = generate(small(), whole_store)
    assert store.info.pushes == 28
    assert before == {path: path.stat().st_mtime_ns for path in whole_store.rglob("*")}


def test_other_settings_conflict_and_touch_nothing(whole_store):
    before = contents(whole_store)
    with pytest.raises(RunConflict, match="config.json: seed is 0, not 1"):
        generate(small(seed=1), whole_store)
    assert contents(whole_store) == before


def test_other_seeds_make_other_pushes(whole_store, tmp_path):
    other = generate(small(seed=1, pushes=5), tmp_path / "store")
    first = open_store(whole_store)
    for name in ("mass", "truth", "measured"):
        one, two = (s.read(slice(0, 5), (name,))[name] for s in (first, other))
        assert not np.array_equal(one, two)


def test_a_lost_chunk_is_made_again_and_an_edited_one_is_named(whole_store, tmp_path):
    out = tmp_path / "store"
    shutil.copytree(whole_store, out)
    hashes = json.loads((out / schema.HASHES).read_text())["files"]
    (out / schema.HASHES).unlink()
    info = open_store(whole_store).info
    (out / writer.PROGRESS).mkdir()
    for index in range(info.chunks):
        receipt = {name: hashes[name] for name in writer.chunk_files(info, index)}
        path = out / writer.PROGRESS / f"chunk-{index:06d}.json"
        write_document(path, schema.Listing(files=receipt))
    edited = out / schema.ARRAYS / "truth" / "c" / "2" / "0" / "0" / "0"
    edited.write_bytes(b"x")
    (out / schema.ARRAYS / "truth" / "c" / "1" / "0" / "0" / "0").unlink()
    (out / schema.ARRAYS / "truth" / "c" / "3.0.partial").write_bytes(b"x")
    with pytest.raises(BadInput, match=r"c/2/0/0/0: seal: the file was edited"):
        generate(small(), out)
    edited.unlink()
    assert writer.missing_chunks(out, info) == [1, 2]
    generate(small(), out)
    assert_same_files(out, whole_store)


def test_progress_adds_up(tmp_path):
    told = []
    generate(small(pushes=7), tmp_path / "store", on_pushes=told.append)
    assert told == [0, 5, 2]


# Full disks.


@pytest.mark.slow
def test_disks_without_room_leave_nothing_behind(tmp_path):
    config = GenerateConfig(disks=3, placement_deg=1.0, pushes=4, chunk_size=4)
    with pytest.raises(BadInput, match="could not be placed"):
        generate(config, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_no_room_in_a_later_chunk_is_found_before_any_work(tmp_path):
    """Eight chunks, of which only the sixth cannot be drawn."""
    config = GenerateConfig(disks=3, placement_deg=32.3, pushes=40, chunk_size=5)
    with pytest.raises(BadInput, match="could not be placed"):
        generate(config, tmp_path / "out")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    "engines", [{"engine": "bullet"}, {"assumed_engine": ("bullet-true",)}]
)
def test_more_disks_than_bullet_can_have_leave_nothing_behind(tmp_path, engines):
    require(find_spec("pybullet"), "PyBullet is not installed")
    with pytest.raises(BadInput, match="`disks` is 31; it must be at most 30 with"):
        generate(GenerateConfig(disks=31, pushes=1, **engines), tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_more_steps_than_a_push_can_have_leave_nothing_behind(tmp_path):
    config = GenerateConfig(stroke_mm=(1000.0,), speed_mm_s=(0.5,), pushes=1)
    with pytest.raises(
        BadInput, match=r"`stroke_mm` is 1000.0; .* `hold_steps` fewer: 480"
    ):
        generate(config, tmp_path / "out")
    assert not (tmp_path / "out").exists()


class LostEngine(PlanarEngine):
    """Predicts NaN."""

    def rollout(self, scene, initial, controls):
        found = super().rollout(scene, initial, controls)
        return jax.tree.map(lambda x: x * jnp.nan, found)


def test_a_truth_of_nan_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr("sainet.datasets.generate.make_engine", lambda _: LostEngine())
    with pytest.raises(Diverged, match="push 0 of the dataset: engine planar gave"):
        generate(small(pushes=7, noise_level="none"), tmp_path / "store")
    assert not (tmp_path / "store").exists()


def test_pushes_that_could_not_be_read_again_are_refused(tmp_path):
    hard = {"force_n": 2000.0, "damping_n_s_m": 0.0, "pushes": 1}
    says = r"truth.*: push 0: .* it must be from .*; reduce `force_n` or `force_steps`"
    with pytest.raises(BadInput, match=says):
        generate(GenerateConfig(setup="direct-force", **hard), tmp_path / "store")
    assert not (tmp_path / "store").exists()


def test_a_missing_engine_leaves_nothing_behind(tmp_path, monkeypatch):
    monkeypatch.setattr("sainet.engines.bullet.engine.find_spec", lambda _: None)
    for engines in ({"engine": "bullet"}, {"assumed_engine": ("planar", "bullet")}):
        with pytest.raises(MissingExtra, match="needs PyBullet"):
            generate(GenerateConfig(pushes=4, **engines), tmp_path / "out")
        assert not (tmp_path / "out").exists()


def test_a_full_disk_is_reported_and_the_run_resumes(whole_store, tmp_path):
    with small_disk(tmp_path / "disk") as disk:
        process = start_generating(disk / "store")
        message = process.communicate(timeout=120)[1]
        assert process.returncode == 1
        assert message.startswith("BadInput: ")
        assert "the disk is full; make room" in message
        assert len(message.strip().splitlines()) == 1
        assert not list(disk.rglob("*.partial"))
        subprocess.run(["mount", "-o", "remount,size=64m", disk], check=True)
        generate(small(), disk / "store")
        assert_same_files(disk / "store", whole_store)


@contextmanager
def small_disk(path):
    """A file system with hardly any room, where this user may mount one."""
    path.mkdir()
    command = ["mount", "-t", "tmpfs", "-o", "size=600k", "tmpfs", str(path)]
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=False)
    except FileNotFoundError:
        pytest.skip("no mount command")
    if done.returncode:
        pytest.skip(f"no small file system can be mounted: {done.stderr.strip()}")
    try:
        yield path
    finally:
        subprocess.run(["umount", str(path)], check=True)


@pytest.mark.parametrize("moment", [0, 1, 2, 6])
def test_no_space_for_a_json_file_is_reported(
    whole_store, tmp_path, monkeypatch, moment
):
    out, count = tmp_path / "store", itertools.count()
    write = type(out).write_bytes

    def full(path, data):
        if next(count) == moment:
            write(path, data[: len(data) // 2])
            raise OSError(errno.ENOSPC, "No space left on device")
        return write(path, data)

    monkeypatch.setattr(type(out), "write_bytes", full)
    with pytest.raises(BadInput, match="the disk is full; make room"):
        generate(small(), out)
    monkeypatch.undo()
    assert not list(tmp_path.rglob("*.partial"))
    generate(small(), out)
    assert_same_files(out, whole_store)
