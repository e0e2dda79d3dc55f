"""Shards: which pieces they take, and what is never mixed."""

import json

import pytest

from sainet.runs.documents import write_first, write_json
from sainet.runs.errors import BadSetting, RunConflict
from sainet.runs.folders import CONFIG, open_run
from sainet.runs.manifest import MANIFEST, manifest
from sainet.runs.shards import SHARDS, Shard, collect, open_share

SETTINGS = {"command": "test", "seed": 3}


def test_shards_divide_the_pieces():
    shards = [Shard.parse(f"{number}/3") for number in (1, 2, 3)]
    assert [shard.own(8) for shard in shards] == [[0, 3, 6], [1, 4, 7], [2, 5]]
    assert [str(shard) for shard in shards] == ["1/3", "2/3", "3/3"]
    assert Shard.parse("2/9").own(1) == []


@pytest.mark.parametrize(
    "text", ["0/4", "5/4", "a/b", "", "1", "1/", "-1/4", "1/4/2", " 1/4", "²/4", "1/0"]
)
def test_other_texts_name_no_shard(text):
    with pytest.raises(BadSetting, match="`shard` is .*; it must be .* example 3/8"):
        Shard.parse(text)


def finish(out, number, *, settings=SETTINGS):
    """A shard that finishes one piece."""
    with open_share(out, settings, Shard(number, 3)) as share:
        share.add(f"piece-{number}")


def test_pieces_are_collected_and_the_lists_removed(tmp_path):
    assert collect(tmp_path, SETTINGS) is None
    finish(tmp_path, 1)
    finish(tmp_path, 3)
    found = collect(tmp_path, SETTINGS)
    assert (found.pieces, found.shards) == ({"piece-1", "piece-3"}, 2)
    found.clear()
    assert not (tmp_path / SHARDS).exists()


def test_what_is_missing_is_counted(tmp_path, caplog):
    finish(tmp_path, 2)
    found = collect(tmp_path, SETTINGS)
    found.tell(0, 3)
    assert not caplog.messages
    found.tell(2, 3)
    assert caplog.messages == [
        f"{tmp_path}: 2 of 3 pieces are missing from 1 shards; they are made now."
    ]


def test_a_shard_goes_on_and_sees_the_others(tmp_path):
    finish(tmp_path, 1)
    with open_share(tmp_path, SETTINGS, Shard(1, 3)) as one:
        finish(tmp_path, 2)  # at once
        one.add("piece-4")
        assert one.finished() == {"piece-1", "piece-2", "piece-4"}


def test_while_a_shard_is_at_work_nothing_is_collected(tmp_path):
    with (
        open_share(tmp_path, SETTINGS, Shard(1, 3)),
        pytest.raises(RunConflict, match="another sainet process is using"),
    ):
        collect(tmp_path, SETTINGS)
    found = collect(tmp_path, SETTINGS)
    assert found is not None
    with pytest.raises(RunConflict, match="another sainet process is using"):
        finish(tmp_path, 2)


def test_shards_of_other_settings_are_refused(tmp_path):
    finish(tmp_path, 1)
    other = SETTINGS | {"seed": 4}
    wanted = r"config\.json: seed is 3, not 4"
    with pytest.raises(RunConflict, match=wanted):
        finish(tmp_path, 2, settings=other)
    with pytest.raises(RunConflict, match=wanted):
        collect(tmp_path, other)


@pytest.mark.parametrize("name", ["sainet", "git_commit"])
def test_shards_of_other_versions_are_refused(tmp_path, name):
    finish(tmp_path, 1)
    path = tmp_path / SHARDS / MANIFEST
    made = json.loads(path.read_text())
    (made if name == "git_commit" else made["versions"])[name] = "0.0.1"
    write_json(path, made)
    wanted = rf"manifest\.json: {name} is 0\.0\.1, not .*; use the version that began"
    with pytest.raises(RunConflict, match=wanted):
        finish(tmp_path, 2)
    with pytest.raises(RunConflict, match=wanted):
        collect(tmp_path, SETTINGS)


@pytest.mark.parametrize(
    ("text", "says"), [('{"names": 3}', "names: "), ('{"names": []}', "seal: missing")]
)
def test_a_damaged_list_is_named(tmp_path, text, says):
    finish(tmp_path, 2)
    (tmp_path / SHARDS / "2-of-3.json").write_text(text)
    with pytest.raises(RunConflict, match=rf"2-of-3\.json: {says}.* Delete it"):
        collect(tmp_path, SETTINGS)


def test_only_the_first_writer_writes(tmp_path):
    for value in (1, 2):
        write_first(tmp_path / "a", value)
    assert (tmp_path / "a").read_text() == "1\n"
    assert [path.name for path in tmp_path.iterdir()] == ["a"]


def test_a_second_first_writer_without_hard_links_replaces(tmp_path, monkeypatch):
    def refuse(*paths):
        raise PermissionError

    monkeypatch.setattr("os.link", refuse)
    write_first(tmp_path / "a", 1)
    assert [path.name for path in tmp_path.iterdir()] == ["a"]


def test_settings_that_came_between_are_noticed(tmp_path, monkeypatch):
    """Two shards of different settings begin in an empty folder at the same time."""

    def late(path, value):
        if path.name == CONFIG:
            write_first(path, {"seed": 4})  # by the other one
        write_first(path, value)

    monkeypatch.setattr("sainet.runs.documents.write_first", late)
    with pytest.raises(RunConflict, match="seed is 4, not 3"):
        open_run(tmp_path, {"seed": 3}, finished_by="end", shared=True)


def test_settings_that_came_before_the_manifest_are_noticed(tmp_path, monkeypatch):
    def late(devices):
        write_first(tmp_path / CONFIG, {"seed": 4})  # by the other one
        return manifest(devices)

    monkeypatch.setattr("sainet.runs.folders.manifest", late)
    with pytest.raises(RunConflict, match="seed is 4, not 3"):
        open_run(tmp_path, {"seed": 3}, finished_by="end", shared=True)


def test_leftovers_of_shards_at_work_stay(tmp_path):
    (tmp_path / ".config.json.0.partial").touch()
    open_run(tmp_path, SETTINGS, finished_by="end", shared=True)
    assert (tmp_path / ".config.json.0.partial").exists()
    open_run(tmp_path, SETTINGS, finished_by="end")
    assert not (tmp_path / ".config.json.0.partial").exists()
