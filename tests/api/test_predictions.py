"""Files of predictions are read exactly, and hostile ones refused in one line."""

import io
import zipfile

import jax.numpy as jnp
import numpy as np
import pytest

import sainet as sn
from sainet.runs.errors import BadInput
from sainet.tasks.push_to_goal import PushToGoal

STEPS, DISKS = 40, 2


@pytest.fixture(scope="module")
def pose(folder) -> np.ndarray:
    """What the physics model predicts, [push, time, body, 3]."""
    batch = sn.open_pushes(folder / "runs" / "recorded").batch()
    states = (
        sn.load("physics").predict(batch.scene, batch.initial, batch.controls).states
    )
    return np.concatenate([states.position, states.angle[..., None]], axis=-1)


def to_csv(pose, keys, name, *, has_steps=True) -> str:
    """The poses as a table, the last line first."""
    lines = []
    for push, key in enumerate(keys):
        for step in range(pose.shape[1]):
            for body in range(pose.shape[2]):
                counts = [step + 1] if has_steps else []
                numbers = map(repr, map(float, pose[push, step, body]))
                lines.append(",".join(map(str, [key, *counts, body + 1, *numbers])))
    header = f"{name},{'step,' if has_steps else ''}body,x,y,angle"
    return "\n".join([header, *reversed(lines)]) + "\n"


def write(folder, kind, pose, pushes):
    """A file of predictions, keyed in one of four ways."""
    hashes = pushes.hashes
    if kind == "csv-hash":
        path = folder / "file.csv"
        path.write_text(to_csv(pose, [f"{h:012x}" for h in hashes], "hash"))
    elif kind == "csv-row":
        path = folder / "file.csv"
        path.write_text(to_csv(pose, range(len(pose)), "row"))
    else:
        path = folder / "file.npz"
        order = np.random.default_rng(0).permutation(len(pose))
        keys = {
            "npz": {},
            "npz-row": {"row": order},
            "npz-hash": {"hash": hashes[order]},
        }[kind]
        np.savez(path, pose=pose[order] if keys else pose, **keys)
    return path


KINDS = ("csv-hash", "csv-row", "npz", "npz-row", "npz-hash")


@pytest.mark.parametrize("kind", KINDS)
def test_predictions_from_a_file_have_the_errors_of_their_model(
    kind, pose, pushes, tmp_path
):
    path = write(tmp_path, kind, pose, pushes)
    theirs = sn.from_predictions(path, pushes, name="theirs")
    _, test = pushes.split(test=0.4)
    table = sn.evaluate({"physics": "physics", "theirs": theirs}, test)
    for name in ("pos_mm", "rot_deg", "final_pos_mm"):
        one, other = (table.measured.values(name, m) for m in ("physics", "theirs"))
        np.testing.assert_allclose(one, other, atol=1e-3)
        assert one.max() > 0.01


def test_final_poses_have_only_errors_at_the_end(pose, pushes, tmp_path):
    np.savez(tmp_path / "ends.npz", pose=pose[:, -1], hash=pushes.hashes)
    rows = [f"{h:012x}" for h in pushes.hashes]
    text = to_csv(pose[:, -1:], rows, "hash", has_steps=False)
    (tmp_path / "ends.csv").write_text(text)
    for name in ("ends.npz", "ends.csv"):
        ends = sn.from_predictions(tmp_path / name)
        assert ends.name == "ends"
        table = sn.evaluate(["physics", ends], pushes).measured
        physics = table.values("final_pos_mm", "physics")
        np.testing.assert_allclose(table.values("final_pos_mm", "ends"), physics, 1e-3)
        assert np.isnan(table.values("pos_mm", "ends")).all()


def test_a_file_predicts_only_its_own_pushes(pose, pushes, tmp_path):
    few = write(tmp_path, "npz", pose[:5], pushes)
    some = sn.from_predictions(few, pushes.first(5), name="some")
    with pytest.raises(BadInput, match="no prediction of 7 of the 12 pushes"):
        sn.evaluate([some], pushes)
    task, scene = PushToGoal(jnp.zeros(2)), sn.Scene.disks([1, 1], [0.05, 0.05])
    with pytest.raises(BadInput, match="can neither predict others nor plan"):
        sn.make_planner("tree").plan(some.dynamics, task, scene, scene.in_a_row())


def test_rows_of_one_push_with_different_predictions_are_refused(tmp_path):
    """Disks that differ only in mass have one hash: no row may take another's place."""
    same = {"radius_mm": (55.0,), "contact_angle_deg": 0.0, "direction_deg": 0.0}
    config = sn.GenerateConfig(pushes=4, **same, placement_deg=0.0)
    pushes = sn.generate(config, tmp_path / "same")
    assert len(set(pushes.hashes)) == 1
    poses = np.asarray(pushes.batch().truth)[..., :3]
    np.savez(tmp_path / "theirs.npz", pose=poses, row=np.arange(4))
    with pytest.raises(BadInput, match="predictions 0 and 1 differ, but are of one"):
        sn.from_predictions(tmp_path / "theirs.npz", pushes)
    np.savez(tmp_path / "alike.npz", pose=poses[[0] * 4], row=np.arange(4))
    assert sn.evaluate([sn.from_predictions(tmp_path / "alike.npz", pushes)], pushes)


def test_quoted_names_of_columns_are_read(pose, pushes, tmp_path):
    path = write(tmp_path, "csv-hash", pose, pushes)
    header, rest = path.read_text().split("\n", 1)
    names = ", ".join(f'"{name}"' for name in header.split(",")).replace(", ", " ,")
    (tmp_path / "quoted.csv").write_text(f"{names}\n{rest}")
    (tmp_path / "returns.csv").write_text(path.read_text().replace("\n", "\r"))
    expected = sn.from_predictions(path).dynamics.pose
    for name in ("quoted.csv", "returns.csv"):
        found = sn.from_predictions(tmp_path / name).dynamics.pose
        np.testing.assert_array_equal(found, expected)


@pytest.mark.parametrize("kind", KINDS)
def test_one_prediction_suffices(kind, pose, pushes, tmp_path):
    one = pushes.first(1)
    found = sn.from_predictions(write(tmp_path, kind, pose[:1], one), one)
    assert sn.evaluate([found], one)


def test_predictions_of_another_size_are_refused(pose, pushes, tmp_path):
    short = write(tmp_path, "npz", pose[:, :9], pushes)
    with pytest.raises(BadInput, match="predicts 9 steps, the pushes have 40"):
        sn.evaluate([sn.from_predictions(short, pushes)], pushes)
    alone = write(tmp_path, "npz", pose[:, :, :1], pushes)
    with pytest.raises(BadInput, match="predicts 1 bodies, the pushes have 2"):
        sn.evaluate([sn.from_predictions(alone, pushes)], pushes)


def npz(**arrays) -> bytes:
    stream = io.BytesIO()
    np.savez_compressed(stream, **arrays)
    return stream.getvalue()


def claiming(shape: str) -> bytes:
    """An array of which only the header is there."""
    stream = io.BytesIO()
    header = f"{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}}}\n".encode()
    with zipfile.ZipFile(stream, "w") as archive:
        archive.writestr(
            "pose.npy",
            b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little") + header,
        )
    return stream.getvalue()


GOOD = np.zeros((2, 40, 2, 3))
HOSTILE = {
    "empty": (b"", "not a .npz file"),
    "text": (b"pose", "not a .npz file"),
    "cut": (npz(pose=GOOD)[:-30], "not a .npz file"),
    "objects": (npz(pose=np.array([{}, 1], object)), "not a .npz file"),
    "claim": (claiming("(1000000, 1000000, 2, 3)"), "not a .npz file"),
    "nothing": (npz(other=GOOD), "pose is missing"),
    "flat": (npz(pose=np.zeros((2, 6))), r"pose is of the shape \[2, 6\]"),
    "no push": (npz(pose=GOOD[:0]), "pose is empty"),
    "words": (npz(pose=GOOD.astype(str)), "not of floating-point numbers"),
    "nan": (npz(pose=np.full_like(GOOD, np.nan)), "pose, x is nan"),
    "mm": (npz(pose=GOOD + 200), r"x is 200 \(in millimetres\?\)"),
    "keys": (npz(pose=GOOD, hash=np.arange(3)), "must be 2 whole numbers"),
    "float keys": (npz(pose=GOOD, row=np.ones(2)), "must be 2 whole numbers"),
    "twice": (npz(pose=GOOD, hash=np.ones(2, int)), "hash 1 is there twice"),
    "row": (npz(pose=GOOD, row=np.array([0, 12])), "row is 12; there are 12 pushes"),
    "negative": (npz(pose=GOOD, row=np.array([0, -1])), "row is -1"),
}


@pytest.mark.parametrize("what", HOSTILE)
def test_a_hostile_npz_file_is_refused(what, pushes, tmp_path):
    data, words = HOSTILE[what]
    (tmp_path / "bad.npz").write_bytes(data)
    with pytest.raises(BadInput, match=words) as error:
        sn.from_predictions(tmp_path / "bad.npz", pushes)
    assert "bad.npz" in str(error.value)
    assert len(str(error.value).splitlines()) == 1


def test_a_file_that_unpacks_to_too_much_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr("sainet.api.predictions.LARGEST", 1 << 20)
    (tmp_path / "bomb.npz").write_bytes(npz(pose=np.zeros((200, 200, 2, 3))))
    with pytest.raises(BadInput, match="bomb.npz: is too large"):
        sn.from_predictions(tmp_path / "bomb.npz")


LINE = "0,1,1,0.0,0.0,0.0\n0,1,2,0.0,0.0,0.0\n"
HEADER = "row,step,body,x,y,angle\n"
BAD_TABLES = {
    "empty": ("", "empty"),
    "header only": (HEADER, "has no rows"),
    "no angle": ("row,body,x,y\n0,1,0,0\n", "column angle is missing"),
    "word": (HEADER + LINE + "0,2,1,a,0,0\n", "row 4: x is 'a'"),
    "infinite": (HEADER + LINE + "0,2,1,inf,0,0\n", "row 4: x is 'inf'"),
    "cut": (HEADER + LINE + "0,2,1\n", "row 4: has 3 fields"),
    "mm": (HEADER + "0,1,1,200,0,0\n", r"x is 200 \(in millimetres\?\)"),
    "twice": (HEADER + LINE + LINE, "has 4 rows; 1 pushes of 1 steps and 2 bodies"),
    "same": (HEADER + LINE + "0,2,1,0,0,0\n0,2,1,0,0,0\n", "is there twice"),
    "half a row": (HEADER + "0.5,1,1,0,0,0\n", "row 2: row is 0.5"),
    "body 0": (HEADER + "0,1,0,0,0,0\n", "body is 0; it must be a whole number"),
    "step 1e9": (HEADER + "0,1e9,1,0,0,0\n", r"step is 1e\+09"),
    "hash": ("hash,body,x,y,angle\nzz,1,0,0,0\n", "not twelve hexadecimal digits"),
    "long": (f"hash,body,x,y,angle\n{'f' * 99},1,0,0,0\n", "not twelve hexadecimal"),
    "binary": ("\0\0", "not CSV text"),
}


@pytest.mark.parametrize("what", BAD_TABLES)
def test_a_bad_table_is_refused(what, pushes, tmp_path):
    text, words = BAD_TABLES[what]
    (tmp_path / "bad.csv").write_text(text)
    with pytest.raises(BadInput, match=words) as error:
        sn.from_predictions(tmp_path / "bad.csv", pushes)
    assert "bad.csv" in str(error.value)


def test_another_file_or_rows_without_pushes_are_refused(pose, pushes, tmp_path):
    with pytest.raises(BadInput, match=r"use \.npz or \.csv"):
        sn.from_predictions("poses.txt")
    with pytest.raises(BadInput, match="missing.npz"):
        sn.from_predictions(tmp_path / "missing.npz")
    path = write(tmp_path, "npz-row", pose, pushes)
    with pytest.raises(BadInput, match="has rows, not hashes"):
        sn.from_predictions(path)
