"""Recorded pushes as a store: what is kept, what is refused, and nothing in between."""

import csv
import json
import os
import resource
import shutil
import signal
import subprocess
import sys
import time
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

from sainet.datasets.batch import to_batch
from sainet.datasets.recorded import importing
from sainet.datasets.recorded.binary import FIELDS
from sainet.datasets.recorded.endpoints import import_endpoints
from sainet.datasets.store import Store, open_store
from sainet.runs.errors import BadInput, BadStore, BadTable, RunConflict
from support import SOURCE

GROUPS = ("abs-10", "abs-20", "plywood-10")


@pytest.fixture(scope="module")
def recorded(
    recorded_pushes_folder: Path, tmp_path_factory: pytest.TempPathFactory
) -> Store:
    """All recorded pushes, imported once."""
    out = tmp_path_factory.mktemp("recorded") / "store"
    return import_endpoints(recorded_pushes_folder, out)


@pytest.fixture(scope="module")
def table(recorded_pushes_folder: Path) -> list[dict[str, str]]:
    with (recorded_pushes_folder / "ellip1_endpoints.csv").open(newline="") as file:
        return list(csv.DictReader(file))


@pytest.fixture
def small(tmp_path: Path) -> Path:
    """A table of two made-up pushes, for what needs no recorded ones."""
    names = "surface,shape,s,t,vel_mm_s,obj_x0,obj_y0,obj_th0,obj_x1,obj_y1,obj_th1,"
    names += "tip_x0,tip_y0,tip_x1,tip_y1,zhou_poly4_x1,zhou_poly4_y1,zhou_poly4_th1"
    rows = [
        "pu,ellip1,0.025,-0.349,100,0.3,0,3.1,0.34,0,-3.1,0.2427,0,0.2927,0,0.35,0,-3.0",
        "abs,ellip1,0.5,0.000,50,0.3,0,0,0.34,0,0.1,0.2427,0,0.2927,0,0.35,0,0.2",
    ]
    folder = tmp_path / "in"
    folder.mkdir()
    path = folder / "pushes.csv"
    path.write_text("\n".join([names, *rows, ""]))
    return path


def columns(table: list[dict[str, str]], *names: str) -> np.ndarray:
    return np.array([[float(row[name]) for name in names] for row in table])


def tree(folder: Path) -> dict[str, bytes]:
    files = (p for p in folder.rglob("*") if p.is_file())
    return {p.relative_to(folder).as_posix(): p.read_bytes() for p in files}


def final(arrays: dict[str, np.ndarray], name: str) -> np.ndarray:
    push = np.arange(len(arrays["steps"]))
    return arrays[name][push, arrays["steps"] - 1, 0, :3]


def final_errors(store: Store, name: str) -> dict[str, tuple[float, float]]:
    """Mean final errors of each group, mm and degrees."""
    arrays = store.read(slice(None))
    published = name.startswith("published")
    found = arrays[name][:, 0] if published else final(arrays, name)
    error = found - final(arrays, "truth")
    position = 1000 * np.linalg.norm(error[:, :2], axis=1)
    rotation = np.rad2deg(np.abs(error[:, 2]))
    in_group = [arrays["group"] == code for code in range(len(store.info.groups))]
    means = [(float(position[g].mean()), float(rotation[g].mean())) for g in in_group]
    return dict(zip(store.info.groups, means, strict=True))


@pytest.mark.recorded
def test_every_push_is_in_its_group(recorded: Store):
    info = recorded.info
    assert (info.kind, info.engine, info.bodies) == ("robot", "recorded", 1)
    assert (info.pushes, info.steps, info.time_step) == (805, 1200, 1 / 240)
    assert info.groups == GROUPS
    assert info.published == ("zhou-poly4",)
    assert info.assumed_engines == ("planar",)
    assert not info.has_measurements
    arrays = recorded.read(slice(None), ("group", "steps"))
    assert Counter(arrays["group"].tolist()) == {0: 273, 1: 271, 2: 261}
    np.testing.assert_array_equal(
        arrays["steps"], np.where(arrays["group"] == 1, 600, 1200)
    )


@pytest.mark.recorded
def test_repeats_share_a_number(recorded: Store, table: list):
    number = dict(zip(recorded.repeats().tolist(), table, strict=True))
    assert len(number) == 600
    plans = [tuple(row[name] for name in ("surface", "s", "t")) for row in table]
    planned = [tuple(number[i][n] for n in ("surface", "s", "t")) for i in number]
    assert len(set(planned)) == len(set(plans)) == 600
    counts = Counter(recorded.repeats().tolist())
    assert Counter(counts.values()) == {1: 395, 2: 205}


@pytest.mark.recorded
def test_end_poses_are_those_of_the_table(recorded: Store, table: list):
    arrays = recorded.read(slice(None))
    before = columns(table, "obj_x0", "obj_y0", "obj_th0")
    after = columns(table, "obj_x1", "obj_y1", "obj_th1")
    np.testing.assert_allclose(arrays["initial"][:, 0, :3], before, atol=3e-7)
    assert not arrays["initial"][..., 3:].any()
    found = final(arrays, "truth")
    np.testing.assert_allclose(found[:, :2], after[:, :2], atol=3e-7)
    turns = (found[:, 2] - after[:, 2]) / (2 * np.pi)
    np.testing.assert_allclose(turns, np.rint(turns), atol=1e-6)
    for angle in (found[:, 2], arrays["published_zhou-poly4"][:, 0, 2]):
        assert np.abs(angle - before[:, 2]).max() < np.pi
    start = columns(table, "tip_x0", "tip_y0")
    np.testing.assert_allclose(arrays["initial_pusher"], start, atol=3e-8)


@pytest.mark.recorded
def test_only_the_last_pose_is_observed(recorded: Store):
    arrays = recorded.read(slice(None))
    np.testing.assert_array_equal(arrays["pose_observed"].sum(axis=1), 1)
    known = np.isfinite(arrays["truth"])
    np.testing.assert_array_equal(known[..., 0, 0], arrays["pose_observed"] > 0)
    np.testing.assert_array_equal(known[..., :3].all((-1, -2)), known[..., 0, 0])
    assert not known[..., 3:].any()
    assert not arrays["rate_observed"].any()
    batch = to_batch(arrays, recorded.info, simulated="planar")
    assert int(batch.pose_observed.sum()) == 805


@pytest.mark.recorded
def test_the_pusher_moves_straight_and_then_holds(recorded: Store, table: list):
    arrays = recorded.read(slice(None))
    where, velocity = arrays["command_position"], arrays["command_velocity"]
    np.testing.assert_array_equal(arrays["truth_pusher"], where)
    start = columns(table, "tip_x0", "tip_y0")
    end = columns(table, "tip_x1", "tip_y1")
    np.testing.assert_allclose(where[:, -1], end, atol=3e-8)
    moved = np.diff(where, axis=1, prepend=arrays["initial_pusher"][:, None])
    np.testing.assert_allclose(moved, velocity / 240, atol=6e-8)
    push = np.arange(805)
    np.testing.assert_allclose(where[push, arrays["steps"] - 1], end, atol=3e-8)
    half = where[push, arrays["steps"] // 2 - 1]
    np.testing.assert_allclose(half, (start + end) / 2, atol=3e-8)
    after = np.arange(1200) >= arrays["steps"][:, None]
    assert not velocity[after].any()
    speed = np.linalg.norm(velocity[:, 0], axis=1) * 1000
    nominal = columns(table, "vel_mm_s")[:, 0]
    np.testing.assert_allclose(speed, nominal, rtol=0.02)


@pytest.mark.recorded
def test_the_disk_is_the_recorded_disk(recorded: Store):
    arrays = recorded.read(slice(0, 3))
    for name, value in {
        **{"mass": 0.8937, "radius": 0.0525, "pusher_radius": 0.00475},
        **{"table_friction": 0.15, "disk_friction": 0.25, "pusher_friction": 0.25},
    }.items():
        np.testing.assert_allclose(arrays[name], value, rtol=1e-6)


@pytest.mark.recorded
def test_the_published_model_has_its_published_errors(recorded: Store):
    found = final_errors(recorded, "published_zhou-poly4")
    position = [found[group][0] for group in GROUPS]
    np.testing.assert_allclose(position, [2.58, 2.48, 2.57], atol=0.01)


@pytest.mark.recorded
def test_physics_has_the_expected_errors(recorded: Store):
    found = final_errors(recorded, "simulated_planar")
    for group, most in zip(GROUPS, (2.9, 2.85, 2.6), strict=True):
        assert 1.0 < found[group][0] < most
        assert found[group][1] < 7.0  # degrees


@pytest.mark.recorded
def test_a_mat_log_gives_the_same_pushes(tmp_path: Path, recorded: Store, table: list):
    rows = [row for row in table if row["surface"] == "plywood"]
    records = np.empty((len(rows), 1), object)
    for index, row in enumerate(rows):
        fields = FIELDS.items()
        records[index, 0] = {
            field: np.array([[float(row[c])] for c in names]) for field, names in fields
        }
    path = tmp_path / "plywood_ellip1_poly4_v10.mat"
    savemat(path, {"record_all": records})
    store = import_endpoints(path, tmp_path / "out")
    assert store.info.groups == ("plywood-10",)
    wanted, found = recorded.read(slice(None)), store.read(slice(None))
    same = wanted["group"] == GROUPS.index("plywood-10")
    for name in wanted.keys() - {"group", "repeat", "simulated_planar"}:
        np.testing.assert_array_equal(found[name], wanted[name][same], err_msg=name)
    np.testing.assert_allclose(
        found["simulated_planar"], wanted["simulated_planar"][same], atol=1e-5
    )


@pytest.mark.recorded
def test_a_square_is_refused(tmp_path: Path, recorded_pushes_folder: Path):
    path = recorded_pushes_folder / "plywood_rect1_poly4_v10.mat"
    with pytest.raises(BadTable, match="shape is 'rect1'; sainet models disks"):
        import_endpoints(path, tmp_path / "out")
    assert not list(tmp_path.iterdir())


def test_other_surfaces_and_speeds_make_groups_and_steps(small: Path, tmp_path: Path):
    store = import_endpoints(small, tmp_path / "out", contact_friction=0.3)
    assert store.info.groups == ("abs-50", "pu-100")
    arrays = store.read(slice(None))
    assert arrays["group"].tolist() == [1, 0]
    assert arrays["steps"].tolist() == [120, 240]
    assert arrays["pusher_friction"] == pytest.approx(0.3)
    angle = final(arrays, "truth")[0, 2]
    assert angle == pytest.approx(2 * np.pi - 3.1, abs=1e-6)  # on from 3.1, not back
    published = arrays["published_zhou-poly4"][0, 0, 2]
    assert published == pytest.approx(2 * np.pi - 3.0, abs=1e-6)


def test_the_manifest_names_the_source(small: Path, tmp_path: Path):
    out = tmp_path / "new" / "out"
    import_endpoints(small, out)
    config = json.loads((out / "config.json").read_text())
    assert config["contact_friction"] == 0.25
    assert "sweep" in config["contact_friction_origin"]
    assert "no state in between" in config["observed"]
    assert len(config["source_sha256"]) == 64
    assert (out / "manifest.json").is_file()
    assert [p.name for p in out.parent.iterdir()] == ["out"]


def test_equal_settings_change_nothing_and_others_are_refused(
    small: Path, tmp_path: Path
):
    out = tmp_path / "out"
    first = import_endpoints(small, out)
    before, stamp = tree(out), (out / "hashes.json").stat().st_mtime_ns
    assert import_endpoints(small, out).content == first.content
    with pytest.raises(RunConflict, match="contact_friction"):
        import_endpoints(small, out, contact_friction=0.2)
    small.write_text(small.read_text().replace("0.34", "0.33"))
    with pytest.raises(RunConflict, match="source_sha256"):
        import_endpoints(small, out)
    assert tree(out) == before
    assert (out / "hashes.json").stat().st_mtime_ns == stamp


def test_equal_input_gives_equal_bytes(small: Path, tmp_path: Path):
    for name in ("one", "two"):
        import_endpoints(small, tmp_path / name)
    assert tree(tmp_path / "one") == tree(tmp_path / "two")


def test_foreign_folders_stay_unchanged(small: Path, tmp_path: Path):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "letter.txt").write_text("dear")
    with pytest.raises(RunConflict, match="not a sainet run folder"):
        import_endpoints(small, tmp_path / "out")
    assert tree(tmp_path / "out") == {"letter.txt": b"dear"}
    with pytest.raises(RunConflict, match="is a file"):
        import_endpoints(small, tmp_path / "out" / "letter.txt")


def test_an_empty_folder_is_filled(small: Path, tmp_path: Path):
    (tmp_path / "out").mkdir()
    assert import_endpoints(small, tmp_path / "out").info.pushes == 2


def test_an_unfinished_store_is_made_again(small: Path, tmp_path: Path):
    out = tmp_path / "out"
    import_endpoints(small, out)
    before = tree(out)
    (out / "hashes.json").unlink()
    shutil.rmtree(out / "pushes.zarr" / "truth")
    with pytest.raises(BadStore):
        open_store(out)
    import_endpoints(small, out)
    assert tree(out) == before


def test_bad_input_leaves_nothing_behind(small: Path, tmp_path: Path):
    small.write_text(small.read_text().replace("abs,ellip1", "abs,ellip9"))
    with pytest.raises(BadTable, match="row 3: shape is 'ellip9'; sainet models disks"):
        import_endpoints(small, tmp_path / "out")
    assert [p.name for p in tmp_path.iterdir()] == ["in"]


@pytest.mark.parametrize("value", [-0.1, float("nan"), float("inf")])
def test_an_impossible_friction_is_refused(small: Path, tmp_path: Path, value: float):
    with pytest.raises(BadInput, match="`contact_friction` is"):
        import_endpoints(small, tmp_path / "out", contact_friction=value)
    with pytest.raises(BadInput, match="^`table_friction` is"):
        import_endpoints(small, tmp_path / "out", table_friction=value)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("size", [100, 800, 3000])
def test_an_import_onto_a_full_disk_resumes(small: Path, tmp_path: Path, size: int):
    """A limit on the size of files fails as a full disk does: inside the write."""
    import_endpoints(small, tmp_path / "whole")
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        with pytest.raises(BadInput) as caught:
            import_endpoints(small, tmp_path / "out")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert "the disk is full" in str(caught.value)
    with pytest.raises(BadStore):
        open_store(tmp_path / "out")
    import_endpoints(small, tmp_path / "out")
    assert tree(tmp_path / "out") == tree(tmp_path / "whole")


SLOW = """
import sys, time
from pathlib import Path
from sainet.datasets import writer
from sainet.datasets.recorded import endpoints, importing
importing._CHUNK_SIZE = 1
write_chunk = writer.write_chunk
def slow(*arguments):
    index = write_chunk(*arguments)
    time.sleep(0.3)
    return index
if sys.argv[3] == "slow":
    writer.write_chunk = slow
endpoints.import_endpoints(Path(sys.argv[1]), Path(sys.argv[2]))
"""


@pytest.mark.parametrize("written", [0, 1, 2])
def test_a_killed_import_resumes_with_the_same_bytes(
    small: Path, tmp_path: Path, written: int, monkeypatch: pytest.MonkeyPatch
):
    """Killed with kill -9 before the first chunk, after it, and before the end."""
    monkeypatch.setattr(importing, "_CHUNK_SIZE", 1)
    import_endpoints(small, tmp_path / "whole")
    out = tmp_path / "out"
    environment = os.environ | {"PYTHONPATH": str(SOURCE.parent)}
    command = [sys.executable, "-c", SLOW, str(small), str(out), "slow"]
    process = subprocess.Popen(command, env=environment)
    while process.poll() is None:
        there = (out / "config.json").is_file()
        if there and len(list(out.glob("progress/chunk-*.json"))) >= written:
            break
        time.sleep(0.001)
    process.kill()
    assert process.wait() == -signal.SIGKILL
    with pytest.raises(BadStore):
        open_store(out)
    import_endpoints(small, out)
    assert tree(out) == tree(tmp_path / "whole")
