"""Run folders: atomic writes, settings that must agree, manifests without dates."""

import errno
import os
import re
import subprocess
import sys
from pathlib import Path

import msgspec
import pytest

from sainet.runs.documents import (
    atomic_path,
    content_hash,
    read_document,
    read_file,
    read_json,
    to_json,
    write_bytes,
    write_document,
    write_error,
    write_json,
)
from sainet.runs.errors import BadInput, BadStore, RunConflict
from sainet.runs.folders import open_run
from sainet.runs.manifest import manifest


def files(folder):
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in folder.rglob("*")
        if path.is_file()
    }


@pytest.mark.parametrize(
    "failure", [OSError(errno.ENOSPC, "full"), ValueError(), KeyboardInterrupt()]
)
def test_a_failed_write_keeps_the_old_file(tmp_path, failure):
    path = tmp_path / "file"
    path.write_text("old")
    with (
        pytest.raises((BadInput, ValueError, KeyboardInterrupt)),
        atomic_path(path) as new,
    ):
        new.write_text("half")
        raise failure
    assert files(tmp_path) == {"file": b"old"}


def test_the_old_file_stays_until_the_new_file_is_complete(tmp_path):
    path = tmp_path / "deep" / "file"
    with atomic_path(path) as new:
        new.write_text("new")
        assert not path.exists()
        assert new.parent == path.parent
    assert files(tmp_path) == {"deep/file": b"new"}


def test_values_without_json_write_nothing(tmp_path):
    for value in ({"x": float("nan")}, {"x": object()}):
        with pytest.raises((ValueError, TypeError)):
            write_json(tmp_path / "file.json", value)
    assert files(tmp_path) == {}


@pytest.mark.parametrize("code", [errno.ENOSPC, errno.EDQUOT, errno.EFBIG])
def test_a_full_disk_is_named(tmp_path, code):
    message = str(write_error(tmp_path / "x", OSError(code, "no")))
    assert message.startswith(f"{tmp_path / 'x'}: the disk is full; make room")


def test_a_folder_that_is_a_file_is_named(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(BadInput, match="cannot be written"):
        write_bytes(tmp_path / "file" / "inside", b"")


def test_equal_values_give_equal_bytes(tmp_path):
    assert to_json({"b": 1, "a": [1.5, None]}) == to_json({"a": [1.5, None], "b": 1})
    write_json(tmp_path / "x", {"a": "größer"})
    assert read_json(tmp_path / "x") == {"a": "größer"}
    assert content_hash(b"") == content_hash(b"")
    assert content_hash(b"a") != content_hash(b"b")


@pytest.mark.parametrize(
    "data",
    [b"", b"{", b"[1]", b"3", b"\xff\xfe\x00", b"null", b"[" * 100_000],
    ids=lambda data: repr(data[:9]),
)
def test_files_without_a_json_object_are_named(tmp_path, data):
    (tmp_path / "x.json").write_bytes(data)
    with pytest.raises(
        BadStore, match=re.escape(f"{tmp_path / 'x.json'}: ")
    ) as refused:
        read_json(tmp_path / "x.json", BadStore)
    assert "\n" not in str(refused.value)


def test_a_missing_json_file_is_named(tmp_path):
    with pytest.raises(BadInput, match="x.json: no such file"):
        read_json(tmp_path / "x.json")


def open_here(folder, **config):
    return open_run(folder, config or {"seed": 0}, finished_by="done")


def test_a_new_folder_gets_settings_and_a_manifest(tmp_path):
    run = open_here(tmp_path / "a" / "b", seed=3, size=(1, 2))
    assert files(run.path).keys() == {"config.json", "manifest.json"}
    assert read_json(run.path / "config.json") == {"seed": 3, "size": [1, 2]}
    assert not run.is_finished
    (run.path / "done").write_text("")
    assert run.is_finished


def test_equal_settings_change_nothing(tmp_path):
    open_here(tmp_path / "run", size=(1, 2))
    before = files(tmp_path)
    open_here(tmp_path / "run", size=[1, 2])
    assert files(tmp_path) == before


@pytest.mark.parametrize("other", [{"seed": 1}, {"seed": 0, "more": 1}, {"less": 0}])
def test_other_settings_conflict_and_touch_nothing(tmp_path, other):
    open_here(tmp_path / "run", seed=0)
    (tmp_path / "run" / ".x.partial").write_text("")
    before = files(tmp_path)
    with pytest.raises(RunConflict, match="choose another `out` or the same settings"):
        open_here(tmp_path / "run", **other)
    assert files(tmp_path) == before


def test_foreign_folders_conflict_and_stay_unchanged(tmp_path):
    (tmp_path / "thesis.tex").write_text("years of work")
    with pytest.raises(RunConflict, match="not a sainet run folder"):
        open_here(tmp_path)
    assert files(tmp_path) == {"thesis.tex": b"years of work"}
    with pytest.raises(RunConflict, match="is a file"):
        open_here(tmp_path / "thesis.tex")


def test_a_shard_may_begin_while_another_looks_at_the_folder(tmp_path, monkeypatch):
    listed = Path.iterdir

    def another_begins(path):
        monkeypatch.undo()
        open_run(tmp_path, {"seed": 1}, finished_by="", shared=True)
        return listed(path)

    monkeypatch.setattr(Path, "iterdir", another_begins)
    folder = open_run(tmp_path, {"seed": 1}, finished_by="", shared=True)
    assert folder.path == tmp_path


def test_settings_that_cannot_be_read_conflict(tmp_path):
    (tmp_path / "config.json").write_text("{")
    with pytest.raises(RunConflict, match="config.json"):
        open_here(tmp_path)
    assert files(tmp_path) == {"config.json": b"{"}


def test_a_folder_of_an_earlier_version_is_one_clear_line(tmp_path):
    open_here(tmp_path / "run")
    path = tmp_path / "run" / "manifest.json"
    write_json(path, read_json(path) | {"format_version": 1})
    with pytest.raises(RunConflict, match="made by an earlier version.*make it again"):
        open_here(tmp_path / "run")


def test_documents_of_hostile_fields_name_the_field(tmp_path):
    class Known(msgspec.Struct):
        size: float

    path = tmp_path / "x.json"
    for text, says in (
        ('{"size": "%s"}' % ("x" * 9999), "size: expected `float`"),
        ('{"size": NaN}', "malformed"),
        ('{"size": 1e400}', "malformed|out of range"),
        ('{"size": ' + "[" * 99999, "size: expected|recursion|nested|truncated"),
        ('{"size": 1, "text": "\\ud800"}', "surrogate|malformed|truncated"),
    ):
        path.write_text(text)
        with pytest.raises(
            BadInput, match=f"x.json: .*({says}).*Train it again"
        ) as bad:
            read_document(path, Known, remedy="train it again")
        assert len(str(bad.value)) < 300 + len(str(path))


def test_files_are_regular_and_small_enough(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    for path in (tmp_path / "pipe", Path("/dev/zero"), tmp_path):
        with pytest.raises(BadInput, match=f"{path}: (not a regular|cannot be read)"):
            read_file(path)
    (tmp_path / "x").write_bytes(b"12345")
    assert read_file(tmp_path / "x", most=5) == b"12345"
    with pytest.raises(BadInput, match="larger than 4 bytes"):
        read_file(tmp_path / "x", most=4)
    before = len(os.listdir("/proc/self/fd"))
    for _ in range(5):
        with pytest.raises(BadInput):
            read_file(tmp_path)
    assert len(os.listdir("/proc/self/fd")) == before


def test_a_run_killed_as_it_began_goes_on(tmp_path):
    (tmp_path / ".config.json.0.partial").write_text("{")
    write_document(tmp_path / "manifest.json", manifest())
    open_here(tmp_path)
    assert files(tmp_path).keys() == {"config.json", "manifest.json"}


def test_the_folder_of_an_import_into_this_one_stays(tmp_path):
    (tmp_path / ".mit.0.partial").mkdir()
    open_here(tmp_path)
    open_here(tmp_path)
    assert (tmp_path / ".mit.0.partial").is_dir()


AT_WORK = """
import sys, time
from pathlib import Path
from sainet.runs.folders import open_run
run = open_run(Path(sys.argv[1]), {"seed": 0}, finished_by="done")
print("at work", flush=True)
time.sleep(60)
"""


def test_a_run_folder_is_locked_by_its_process(tmp_path):
    folder = tmp_path / "run"
    command = [sys.executable, "-c", AT_WORK, str(folder)]
    with subprocess.Popen(command, stdout=subprocess.PIPE) as other:
        assert other.stdout is not None
        assert other.stdout.readline() == b"at work\n"
        (folder / ".weights.0.partial").write_text("half")  # is being written
        before = files(tmp_path)
        with pytest.raises(RunConflict, match="another sainet process is using"):
            open_here(folder)
        assert files(tmp_path) == before
        (folder / "done").write_text("")
        assert open_here(folder).is_finished  # whoever only reads may
        (folder / "done").unlink()
        other.kill()
    # What this process has, it may have again: a traceback may keep the first.
    first, second = open_here(folder), open_here(folder)
    assert first.lock is second.lock is not None


def test_an_impossible_folder_name_gives_one_line(tmp_path):
    path = tmp_path / ("x" * 300)
    with pytest.raises(RunConflict, match="cannot be read .*; choose another") as told:
        open_here(path)
    assert "\n" not in str(told.value)


def test_an_empty_folder_is_used(tmp_path):
    assert open_here(tmp_path).path == tmp_path


def test_manifests_depend_on_neither_time_nor_folder(tmp_path, monkeypatch):
    first = manifest(2)
    monkeypatch.setattr("time.time", lambda: 0.0)
    monkeypatch.chdir(tmp_path)
    assert manifest(2) == first
    assert first.devices == 2
    assert first.format_version == 2
    assert first.versions["jax"]
    assert first.versions["scipy"]
    assert "pybullet" in first.versions  # None where it is not installed
    assert not re.search(r"20\d\d-\d\d|\d\d:\d\d", str(first))
    assert os.uname().nodename not in str(first)
