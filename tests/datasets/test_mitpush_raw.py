"""The raw MIT Push dataset: files with every trap, and the motion that is known."""

import json
import zipfile
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from datasets.raw_pushes import (
    SPEED,
    TURNING,
    changed,
    name,
    pack,
    path_of,
    recording,
    tip_of,
    to_hdf5,
    to_json,
    with_traps,
)
from datasets.stores import assert_same_files, contents
from sainet.datasets.batch import to_batch
from sainet.datasets.recorded import archives, importing
from sainet.datasets.recorded.raw import import_mitpush
from sainet.runs.errors import BadInput, BadTable, MissingExtra, RunConflict

WITHIN = 0.0017 + np.arange(1, 239) / 240  # s: steps that were recorded


def skipped(out: Path) -> dict[str, int]:
    return json.loads((out / "config.json").read_text())["skipped"]


def good() -> dict[str, bytes]:
    return {name(): to_json(recording())}


@pytest.fixture(scope="module")
def imported(tmp_path_factory: pytest.TempPathFactory):
    """One push with every trap that can be undone, from a tree of zips."""
    folder = tmp_path_factory.mktemp("raw")
    tree = folder / "tree"
    usable = {
        name(): to_json(with_traps()),
        name(v=60): to_json(recording(0.1)),
    }
    left_out = {name(rep=1): b"[]", name(a=100, v=-1): b"{}", "notes.json": b"{}"}
    pack(tree / "abs" / "ellip1" / "ellip1_json.zip", usable | left_out)
    pack(tree / "abs" / "rect1" / "rect1_h5.zip", {name("h5", shape="rect1"): b"no"})
    return import_mitpush(tree, folder / "out")


def test_imported_motion_equals_the_recorded_motion(imported):
    arrays = imported.read(slice(0, 1))
    truth = arrays["truth"][0, :238, 0]
    np.testing.assert_allclose(truth[:, :2], path_of(WITHIN)[:, :2], atol=1e-6)
    np.testing.assert_allclose(truth[:, 2], path_of(WITHIN)[:, 2], atol=1e-5)
    command = arrays["command_position"][0, :238]
    np.testing.assert_allclose(command, tip_of(WITHIN), atol=1e-6)
    start = path_of(np.array([0.0017]))[0]
    np.testing.assert_allclose(arrays["initial"][0, 0, :3], start, atol=1e-6)
    assert not arrays["initial"][..., 3:].any()
    np.testing.assert_array_equal(arrays["truth_pusher"], arrays["command_position"])


def test_velocities_are_smooth_or_unknown(imported):
    arrays = imported.read(slice(None))
    known = arrays["rate_observed"] > 0
    assert known.sum(axis=1).tolist() == [214, 0]  # too short for the filter: none
    rate = arrays["truth"][..., 0, 3:]
    np.testing.assert_array_equal(np.isfinite(rate).all(axis=-1), known)
    np.testing.assert_allclose(
        rate[known], np.tile([SPEED, 0.2 * SPEED, TURNING], (214, 1)), atol=1e-5
    )
    moving = arrays["command_velocity"][:, :22]
    np.testing.assert_allclose(moving[..., 0], SPEED, rtol=1e-4)


def test_steps_beyond_the_end_are_unobserved(imported):
    arrays = imported.read(slice(None))
    assert arrays["steps"].tolist() == [240, 40]
    assert arrays["pose_observed"].sum(axis=1).tolist() == [238, 22]
    unknown = arrays["pose_observed"] == 0
    assert np.isnan(arrays["truth"][unknown]).all()
    assert np.isfinite(arrays["truth"][~unknown][..., :3]).all()
    end = arrays["command_position"][1, 22]  # the last step that was recorded
    assert not (arrays["command_position"][1, 23:] - end).any()
    assert not arrays["command_velocity"][1, 23:].any()


def test_rejected_pushes_are_counted(imported):
    assert skipped(imported.path) == {
        "under 100 bytes": 1,
        "accelerated": 1,
        "name differs from those of this dataset": 1,
        "shape rect1: not a disk": 1,
    }


def test_the_store_is_evaluated_like_any_other(imported):
    info = imported.info
    assert (info.kind, info.engine, info.bodies) == ("robot", "recorded", 1)
    assert info.groups == ("abs-50", "abs-60")
    assert info.published == ()
    arrays = imported.read(slice(None))
    batch = to_batch(arrays, info, simulated="planar-true")
    assert int(batch.pose_observed.sum()) == 260
    assert arrays["radius"] == pytest.approx(0.0525)


def test_repeats_share_a_number(tmp_path: Path):
    plans = [{"rep": 0}, {"t": 0.349}, {"rep": 1}, {"v": 60}]
    files = {
        name(**plan): to_json(recording(0.2 + 0.01 * number))
        for number, plan in enumerate(plans)
    }
    store = import_mitpush(pack(tmp_path / "a.zip", files), tmp_path / "out")
    assert Counter(Counter(store.repeats().tolist()).values()) == {3: 1, 1: 1}


def test_chunks_do_not_change_what_is_stored(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    """Three pushes in chunks of two: the second chunk is not full."""
    files = {name(rep=i): to_json(recording(0.1 + 0.1 * i)) for i in range(3)}
    path = pack(tmp_path / "a.zip", files)
    whole = import_mitpush(path, tmp_path / "whole").read(slice(None))
    monkeypatch.setattr(importing, "_CHUNK_SIZE", 2)
    store = import_mitpush(path, tmp_path / "parts")
    assert store.info.chunk_size == 2
    parts = store.read(slice(None))
    for key in whole:
        if key.startswith("simulated"):  # compiled for another number of pushes
            np.testing.assert_allclose(parts[key], whole[key], atol=1e-5)
        else:
            np.testing.assert_array_equal(parts[key], whole[key], err_msg=key)


def test_json_and_hdf5_give_equal_stores(tmp_path: Path):
    pack(tmp_path / "json.zip", {"deep/" + name(): to_json(with_traps())})
    (tmp_path / "h5").mkdir()
    (tmp_path / "h5" / name("h5")).write_bytes(to_hdf5(with_traps()))
    one = import_mitpush(tmp_path / "json.zip", tmp_path / "one").read(slice(None))
    other = import_mitpush(tmp_path / "h5", tmp_path / "other").read(slice(None))
    for key, value in one.items():
        np.testing.assert_array_equal(other[key], value, err_msg=key)


def test_without_h5py_the_message_names_the_extra(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setitem(__import__("sys").modules, "h5py", None)
    path = pack(tmp_path / "ellip1_h5.zip", {name("h5"): bytes(200)})
    with pytest.raises(MissingExtra, match=r"pip install 'sainet\[hdf5\]'"):
        import_mitpush(path, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_damaged_hdf5_is_left_out(tmp_path: Path):
    whole = to_hdf5(recording())
    files = {name("h5"): to_hdf5(recording())}
    files |= {name("h5", rep=i): whole[: len(whole) * i // 4] for i in (1, 2, 3)}
    path = pack(tmp_path / "ellip1_h5.zip", files)
    assert import_mitpush(path, tmp_path / "out").info.pushes == 1
    assert skipped(tmp_path / "out") == {"damaged, or not a recording of a push": 3}


def test_duplicate_pushes_count_once(tmp_path: Path):
    tree = tmp_path / "tree"
    pack(tree / "ellip1_json.zip", good())
    pack(tree / "ellip1_h5.zip", {name("h5"): bytes(200)})
    assert import_mitpush(tree, tmp_path / "out").info.pushes == 1
    assert skipped(tmp_path / "out") == {"the same push in another file": 1}


def stamps(key: str, rows: slice, change: float):
    def apply(arrays: dict[str, np.ndarray]) -> None:
        arrays[key][rows, 0] += change

    return apply


def inside(arrays: dict[str, np.ndarray]) -> None:
    arrays["tip_pose"][:, 1] += 0.006


def values(key: str, rows: slice, column: int, change: float):
    def apply(arrays: dict[str, np.ndarray]) -> None:
        arrays[key][rows, column] += change

    return apply


UNUSABLE = {
    "object_pose: the clock runs backwards": stamps("object_pose", slice(50, 52), -0.1),
    "tip_pose: the clock runs backwards": stamps("tip_pose", slice(9, None), -1.0),
    "the body jumps": values("object_pose", slice(90, None), 1, 0.006),
    "the pusher jumps": values("tip_pose", slice(90, None), 2, -0.006),
    "the angle jumps": values("object_pose", slice(90, None), 3, 0.6),
    "object_pose has a gap of more than 50 ms": stamps(
        "object_pose", slice(120, None), 0.2
    ),
    "an overlap at the start": inside,
    "the place is out of range": values("object_pose", slice(None), 1, 9),
    "object_pose contains NaN, infinity or too many samples": values(
        "object_pose", slice(3, 4), 1, np.nan
    ),
    "lasts less than a step, or its clocks share no time": stamps(
        "tip_pose", slice(None), 5.0
    ),
    "tip_pose is not N x 4 numbers": lambda a: a.update(tip_pose=a["tip_pose"][:, :3]),
    "fewer than two samples": lambda a: a.update(tip_pose=a["tip_pose"][:1]),
    "damaged, or not a recording of a push": lambda a: a.pop("object_pose"),
}


def test_every_unusable_push_is_named_and_counted(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
):
    """Each reason has one push of its own, beside a good one that is kept."""
    files = {
        name(rep=row): changed(change) for row, change in enumerate(UNUSABLE.values())
    }
    broken = {name(t=0.5): to_json(recording())[:-200], name(t=0.6): b"[" * 5000}
    whole = good() | files | broken
    path = pack(tmp_path / "ellip1_json.zip", whole, zipfile.ZIP_STORED)
    assert import_mitpush(path, tmp_path / "out").info.pushes == 1
    counts = dict.fromkeys(UNUSABLE, 1)
    counts["damaged, or not a recording of a push"] += len(broken)
    assert skipped(tmp_path / "out") == counts
    for member in (*files, *broken):
        assert f"{member}' is left out: " in caplog.text


@pytest.mark.parametrize("turn", [np.pi / 2, -np.pi / 2, np.pi, 1.5 * np.pi])
def test_symmetric_marker_flips_are_corrected(tmp_path: Path, turn: float):
    files = {name(): changed(values("object_pose", slice(77, None), 3, turn))}
    store = import_mitpush(pack(tmp_path / "a.zip", files), tmp_path / "out")
    yaw = store.read(slice(None))["truth"][0, :238, 0, 2]
    np.testing.assert_allclose(yaw, path_of(WITHIN)[:, 2], atol=1e-5)


def encrypted(path: Path) -> None:
    pack(path, good(), zipfile.ZIP_STORED)
    data = bytearray(path.read_bytes())
    data[6] |= 1  # of the member
    data[data.rindex(b"PK\1\2") + 8] |= 1  # of the directory
    path.write_bytes(data)


def truncated(path: Path) -> None:
    pack(path, good())
    path.write_bytes(path.read_bytes()[:-100])


def flipped(path: Path) -> None:
    pack(path, good(), zipfile.ZIP_STORED)
    data = bytearray(path.read_bytes())
    data[2000] ^= 1
    path.write_bytes(data)


def lying(path: Path) -> None:
    """An archive whose directory states too small a size for a file."""
    pack(path, good())
    data = bytearray(path.read_bytes())
    at = data.rindex(b"PK\1\2") + 24
    data[at : at + 4] = (5000).to_bytes(4, "little")
    path.write_bytes(data)


def member(text: str):
    return lambda path: pack(path, good() | {text: b"x"})


HOSTILE = {
    "truncated": (truncated, "is damaged"),
    "bad checksum": (flipped, "is damaged"),
    "lies of its size": (lying, "is damaged"),
    "encrypted": (encrypted, "is encrypted; give it unlocked"),
    "parent": (member("../" + name()), "leaves its folder"),
    "inner parent": (member("a/../../b.json"), "leaves its folder"),
    "absolute": (member("/etc/passwd"), "'/etc/passwd' leaves its folder"),
    "drive": (member("C:/x.json"), "leaves its folder"),
    "backslash": (member("a\\b.json"), "not a file name"),
    "line break": (member("../a\nb"), r"\\nb"),
    "bomb": (lambda p: pack(p, {name(): bytes(9 << 20)}), "packed more than 100 times"),
    "large": (
        lambda p: pack(p, {name(): bytes(17 << 20)}, zipfile.ZIP_STORED),
        "is too large",
    ),
    "bzip2": (lambda p: pack(p, good(), zipfile.ZIP_BZIP2), "unusual way"),
    "no zip": (lambda p: p.write_text("hello"), "is damaged"),
    "empty": (lambda p: pack(p, {}), "has no push that can be used"),
    "no disks": (
        lambda p: pack(p, {name(shape="hex"): b"x"}),
        "sainet models disks.*hex",
    ),
}


@pytest.mark.parametrize("case", HOSTILE)
def test_hostile_archives_give_one_line_and_leave_nothing(tmp_path: Path, case: str):
    make, wanted = HOSTILE[case]
    path = tmp_path / "ellip1_json.zip"
    make(path)
    with pytest.raises(BadTable, match=wanted) as caught:
        import_mitpush(path, tmp_path / "out")
    assert str(path) in str(caught.value)
    assert len(str(caught.value).splitlines()) == 1
    assert [p.name for p in tmp_path.iterdir()] == ["ellip1_json.zip"]


def test_the_total_size_of_files_is_limited(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    path = pack(tmp_path / "a.zip", {name(rep=i): to_json(recording()) for i in (1, 2)})
    monkeypatch.setattr(archives, "LARGEST_SUM", int(1.5 * len(to_json(recording()))))
    with pytest.raises(BadTable, match="_rep=0002.json' is too large"):
        import_mitpush(path, tmp_path / "out")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("path", ["nowhere", "nowhere.zip", "pushes.csv"])
def test_a_path_that_is_neither_folder_nor_archive_is_refused(
    tmp_path: Path, path: str
):
    (tmp_path / "pushes.csv").write_text("t")
    with pytest.raises(BadTable, match="neither a .zip nor a folder"):
        import_mitpush(tmp_path / path, tmp_path / "out")


def test_equal_input_gives_equal_bytes_and_other_input_is_refused(
    tmp_path: Path,
):
    path = pack(tmp_path / "ellip1_json.zip", good())
    for out in ("one", "two", "two"):
        import_mitpush(path, tmp_path / out)
    assert_same_files(tmp_path / "one", tmp_path / "two")
    before = contents(tmp_path / "one")
    with pytest.raises(RunConflict, match="contact_friction"):
        import_mitpush(path, tmp_path / "one", contact_friction=0.2)
    pack(path, {name(): to_json(with_traps())})
    with pytest.raises(RunConflict, match="source_sha256"):
        import_mitpush(path, tmp_path / "one")
    assert contents(tmp_path / "one") == before


def test_an_import_does_not_read_its_own_output(tmp_path: Path):
    pack(tmp_path / "ellip1_json.zip", good())
    out = tmp_path / "runs" / "mit"
    for _ in range(2):
        import_mitpush(tmp_path, out)
    assert skipped(out) == {}


def test_a_disk_far_from_the_pusher_is_left_out(tmp_path: Path):
    def away(arrays: dict[str, np.ndarray]) -> None:
        arrays["tip_pose"][:, 2] += 1.0

    path = pack(tmp_path / "a.zip", good() | {name(rep=1): changed(away)})
    assert import_mitpush(path, tmp_path / "out").info.pushes == 1
    assert skipped(tmp_path / "out") == {"a disk moves untouched": 1}


def test_an_impossible_friction_is_refused(tmp_path: Path):
    path = pack(tmp_path / "ellip1_json.zip", good())
    with pytest.raises(BadInput, match="`contact_friction` is"):
        import_mitpush(path, tmp_path / "out", contact_friction=-1)
    assert not (tmp_path / "out").exists()
