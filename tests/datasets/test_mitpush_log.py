"""Reading recorded pushes: the table, the authors' log, and what is neither."""

import csv
from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

from sainet.datasets.recorded.binary import FIELDS, read_mat
from sainet.datasets.recorded.endpoints import (
    COLUMNS,
    Endpoints,
    find_log,
    read_endpoints,
)
from sainet.datasets.recorded.problems import Problems
from sainet.datasets.recorded.properties import mitpush_properties
from sainet.runs.errors import BadTable

ROW = {
    **{"surface": "abs", "shape": "ellip1", "vel_mm_s": 10.0, "s": 0.025, "t": -0.349},
    **{"obj_x0": 0.3, "obj_y0": 0.0, "obj_th0": 1.0},
    **{"obj_x1": 0.32, "obj_y1": 0.01, "obj_th1": 1.2},
    **{"tip_x0": 0.2427, "tip_y0": 0.0, "tip_x1": 0.2927, "tip_y1": 0.0},
    **{"zhou_poly4_x1": 0.321, "zhou_poly4_y1": 0.012, "zhou_poly4_th1": 1.25},
}


def read_log(path: Path) -> Endpoints:
    file = find_log(path)
    return read_endpoints(file, file.read_bytes(), mitpush_properties(0.25, 0.15))


def poses(log: Endpoints, sample: int) -> np.ndarray:
    """All poses before (0) or after (1) the push."""
    return np.array([recording.pose[sample, 0] for recording in log.recordings])


def tips(log: Endpoints, sample: int) -> np.ndarray:
    return np.array([recording.pusher[sample] for recording in log.recordings])


def surfaces(log: Endpoints) -> list[str]:
    return [recording.conditions.surface for recording in log.recordings]


def plans(log: Endpoints) -> list[str]:
    return [recording.plan for recording in log.recordings]


def write_csv(path: Path, *rows: dict) -> Path:
    with path.open("w", newline="") as file:
        writer = csv.DictWriter(file, list(ROW))
        writer.writeheader()
        writer.writerows(ROW | row for row in rows)
    return path


def write_mat(path: Path, rows: list[dict], **more: object) -> Path:
    """A log in the layout of the authors: a column of cells that hold structures."""
    records = np.empty((len(rows), 1), object)
    for index, row in enumerate(rows):
        columns = FIELDS.items()
        record = {f: np.array([[row[n]] for n in names]) for f, names in columns}
        records[index, 0] = record
    savemat(path, {"record_all": records, **more}, do_compression=True)
    return path


def refusal(path: Path) -> str:
    with pytest.raises(BadTable) as caught:
        read_log(path)
    message = str(caught.value)
    assert "\n" not in message
    assert path.name in message
    return message


def assert_same(one: Endpoints, other: Endpoints):
    np.testing.assert_array_equal(one.published, other.published)
    assert one.model == other.model
    for left, right in zip(one.recordings, other.recordings, strict=True):
        for name in ("time", "pose", "pusher"):
            np.testing.assert_array_equal(getattr(left, name), getattr(right, name))
        assert left.conditions == right.conditions


def test_a_table_states_which_pushes_were_planned_alike(tmp_path):
    rows = [{}, {"t": 0.0}, {"vel_mm_s": 20.0}, {"surface": "plywood"}]
    found = plans(read_log(write_csv(tmp_path / "t.csv", *rows)))
    assert found[0] == found[2]
    assert len(set(found)) == 3
    log = read_log(write_mat(tmp_path / "abs_ellip1_poly4_v10.mat", [ROW]))
    assert plans(log) == [""]


def test_a_table_is_read_in_si_units(tmp_path: Path):
    log = read_log(write_csv(tmp_path / "t.csv", {}, {"vel_mm_s": 20, "tip_y1": 0.03}))
    assert [each.conditions.speed_mm_s for each in log.recordings] == [10, 20]
    lasts = [each.time.tolist() for each in log.recordings]
    assert lasts == [[0, pytest.approx(5.0)], [0, pytest.approx(2.5)]]
    np.testing.assert_array_equal(poses(log, 0)[0], [0.3, 0.0, 1.0])
    np.testing.assert_array_equal(tips(log, 1), [[0.2927, 0.0], [0.2927, 0.03]])
    np.testing.assert_allclose(log.published[1], [0.321, 0.012, 1.25])
    assert log.model == "zhou-poly4"


def test_columns_may_come_in_any_order_with_others_between_and_blank_lines(tmp_path):
    names = ["note", *reversed(ROW)]
    values = ["hello, you", *(str(v) for v in reversed(ROW.values()))]
    path = tmp_path / "t.csv"
    text = ",".join(names) + '\r\n"hello, you",' + ",".join(values[1:]) + "\r\n\r\n"
    path.write_bytes(b"\xef\xbb\xbf" + text.encode())
    assert_same(read_log(path), read_log(write_csv(tmp_path / "plain.csv", {})))


@pytest.mark.recorded
def test_a_mat_log_has_the_rows_of_the_table(
    tmp_path: Path, recorded_pushes_folder: Path
):
    with (recorded_pushes_folder / "ellip1_endpoints.csv").open(newline="") as file:
        found = [r for r in csv.DictReader(file) if r["surface"] == "plywood"]
    rows = [r | {n: float(r[n]) for n in COLUMNS.numbers} for r in found]
    table = read_log(
        write_csv(tmp_path / "t.csv", *[{n: r[n] for n in ROW} for r in rows])
    )
    log = read_log(write_mat(tmp_path / "plywood_ellip1_poly4_v10.mat", rows))
    assert len(log.recordings) == 261
    assert_same(log, table)


@pytest.mark.recorded
def test_the_real_log_of_a_square_is_read_whole(recorded_pushes_folder: Path):
    path = recorded_pushes_folder / "plywood_rect1_poly4_v10.mat"
    table, model = read_mat(path, path.read_bytes(), Problems())
    assert (table.rows, model) == (396, "poly4")
    assert table.texts["surface"].names == ["plywood"]
    assert table.texts["shape"].names == ["rect1"]
    first = {name: values[0] for name, values in table.numbers.items()}
    assert set(table.numbers["vel_mm_s"]) == {10.0}
    assert first["obj_x0"] == pytest.approx(0.34386552, abs=1e-8)
    assert first["obj_th0"] == pytest.approx(-1.17121293, abs=1e-8)
    assert first["obj_x1"] == pytest.approx(0.31308118, abs=1e-8)
    assert first["zhou_poly4_th1"] == pytest.approx(-1.55485916, abs=1e-8)
    ends = [[table.numbers[f"tip_{axis}{end}"] for axis in "xy"] for end in (0, 1)]
    stroke = np.hypot(*np.subtract(*ends))
    assert 0.0494 < stroke.min() < stroke.max() < 0.0507


def test_a_missing_file_names_the_source_of_the_pushes(tmp_path: Path):
    for path in (tmp_path, tmp_path / "ellip1_endpoints.csv", tmp_path / "no" / "dir"):
        with pytest.raises(BadTable, match="robinzhoucmu/Pushing.*eval_logs"):
            read_log(path)


@pytest.mark.parametrize("name", ["surface", "obj_x1", "tip_y0", "zhou_poly4_th1"])
def test_a_missing_column_is_named(tmp_path: Path, name: str):
    path = write_csv(tmp_path / "t.csv", {})
    path.write_text(path.read_text().replace(name, "else"))
    assert f"column {name} is missing" in refusal(path)


def test_a_duplicate_column_is_refused(tmp_path: Path):
    path = write_csv(tmp_path / "t.csv", {})
    text = path.read_text().replace("surface,", "surface,obj_x0,")
    path.write_text(text.replace("abs,", "abs,0.3,"))
    assert "column obj_x0 is there twice" in refusal(path)


@pytest.mark.parametrize(
    ("row", "parts"),
    [
        ({"obj_x1": "nan"}, ["row 3", "obj_x1 is 'nan'", "finite"]),
        ({"tip_y1": "-inf"}, ["row 3", "tip_y1 is '-inf'", "finite"]),
        ({"obj_th0": "12.3.4"}, ["row 3", "obj_th0 is '12.3.4'", "finite number"]),
        ({"obj_x0": "\uff10.\uff13"}, ["row 3", "obj_x0 is '０.３'", "finite number"]),
        ({"obj_x0": "0_3"}, ["row 3", "obj_x0 is '0_3'", "finite number"]),
        ({"tip_x0": ""}, ["row 3", "tip_x0 is ''", "finite number"]),
        ({"vel_mm_s": 0}, ["row 3", "vel_mm_s is 0;", "from 1 to 1000 mm/s"]),
        ({"vel_mm_s": -10}, ["row 3", "vel_mm_s is -10;"]),
        ({"vel_mm_s": 0.01}, ["row 3", "vel_mm_s is 0.01;"]),
        ({"tip_x0": 242.7}, ["row 3", "tip_x0 is 242.7 (in millimetres?)"]),
        ({"obj_th1": 57.3}, ["row 3", "obj_th1 is 57.3 (in degrees?)"]),
        ({"surface": " "}, ["row 3", "surface is empty"]),
        (
            {"obj_x0": 1.3, "obj_x1": 1.32},
            ["row 3", "'ellip1' moves by", "970 mm away"],
        ),
        ({"obj_x0": 1.3}, ["row 3", "'ellip1' moves by 980 mm", "pusher moves by 50"]),
        (
            {"obj_x1": 1.32},
            ["row 3", "'ellip1' moves by 1020 mm", "check their places"],
        ),
        ({"obj_x0": 0.25}, ["row 3", "'ellip1' and the pusher overlap by", "radii"]),
    ],
)
def test_a_bad_value_is_named_with_its_row(tmp_path: Path, row: dict, parts: list[str]):
    message = refusal(write_csv(tmp_path / "t.csv", {}, row, {}))
    for part in parts:
        assert part in message


def test_short_and_long_rows_are_named(tmp_path: Path):
    path = write_csv(tmp_path / "t.csv", {}, {}, {})
    whole = path.read_bytes()
    path.write_bytes(whole[:-30])
    assert "row 4: has 13 fields, not 18" in refusal(path)
    lines = whole.splitlines()
    path.write_bytes(b"\n".join([lines[0], lines[1] + b",7", lines[2], b""]))
    assert "row 2: has 19 fields, not 18" in refusal(path)


def test_an_unclosed_quote_is_refused(tmp_path: Path):
    path = write_csv(tmp_path / "t.csv", {}, {}, {})
    path.write_text(path.read_text().replace("abs", '"abs', 1))
    refusal(path)


def test_empty_and_binary_files_are_refused(tmp_path: Path):
    assert "no rows" in refusal(write_csv(tmp_path / "t.csv"))
    empty = tmp_path / "empty.csv"
    empty.touch()
    assert "empty" in refusal(empty)
    noise = tmp_path / "noise.csv"
    noise.write_bytes(np.random.default_rng(0).bytes(5000))
    assert "not CSV text" in refusal(noise)
    noise.write_bytes(b"\0" * 5000)
    refusal(noise)


def test_a_table_without_a_last_line_break_is_read_with_a_warning(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
):
    path = write_csv(tmp_path / "t.csv", {})
    path.write_bytes(path.read_bytes().rstrip())
    assert len(read_log(path).recordings) == 1
    assert "it may be truncated" in caplog.text


def test_a_truncated_log_is_refused(tmp_path: Path):
    path = write_mat(tmp_path / "abs_ellip1_poly4_v10.mat", [ROW] * 50)
    whole = path.read_bytes()
    for length in range(0, len(whole) - 1, 7):
        path.write_bytes(whole[:length])
        refusal(path)


def test_a_log_with_changed_bytes_gives_no_other_error(tmp_path: Path):
    path = write_mat(tmp_path / "abs_ellip1_poly4_v10.mat", [ROW] * 5)
    whole = path.read_bytes()
    rng = np.random.default_rng(0)
    refused = 0
    for _ in range(300):
        broken = bytearray(whole)
        broken[rng.integers(len(whole))] ^= int(rng.integers(1, 256))
        path.write_bytes(broken)
        try:
            read_log(path)
        except BadTable:
            refused += 1
    assert refused > 100


def test_random_bytes_are_refused(tmp_path: Path):
    path = tmp_path / "abs_ellip1_poly4_v10.mat"
    path.write_bytes(np.random.default_rng(1).bytes(5000))
    assert "damaged or not a MATLAB file" in refusal(path)


@pytest.mark.parametrize("field", FIELDS)
def test_a_log_without_a_field_is_refused(tmp_path: Path, field: str):
    records = np.empty((1, 1), object)
    names = {f: n for f, n in FIELDS.items() if f != field}
    records[0, 0] = {f: np.array([[ROW[c]] for c in n]) for f, n in names.items()}
    path = tmp_path / "abs_ellip1_poly4_v10.mat"
    savemat(path, {"record_all": records})
    assert f"record_all[0]: {field} is missing" in refusal(path)
    savemat(path, {"something": 1.0})
    assert "record_all is missing" in refusal(path)


def test_a_log_with_wrong_sizes_kinds_or_values_is_refused(tmp_path: Path):
    path = tmp_path / "abs_ellip1_poly4_v10.mat"
    message = refusal(write_mat(path, [ROW, ROW | {"tip_x1": np.nan}]))
    assert "record_all[1]: tip_x1 is nan" in message
    for wrong in (np.ones(4), "text", np.ones(3) * 1j):
        records = np.empty((1, 1), object)
        fields = {f: np.array([[ROW[c]] for c in n]) for f, n in FIELDS.items()}
        records[0, 0] = fields | {"init_pose_gt": wrong}
        savemat(path, {"record_all": records})
        assert "init_pose_gt must be 3 real numbers" in refusal(path)
    savemat(path, {"record_all": np.empty((0, 1), object)})
    assert "no rows" in refusal(path)
    savemat(path, {"record_all": np.ones((3, 1))})
    assert "record_all[0]: init_pose_gt is missing" in refusal(path)


def test_the_name_of_a_log_gives_its_conditions(tmp_path: Path):
    assert "SURFACE_SHAPE_MODEL" in refusal(write_mat(tmp_path / "log.mat", [ROW]))
    path = tmp_path / "abs_ellip1_poly4_v10.mat"
    good = write_mat(path, [ROW], shape_id="ellip1", vel=10)
    assert len(read_log(good).recordings) == 1
    assert "'rect1' inside" in refusal(write_mat(path, [ROW], shape_id="rect1"))
    assert "vel is '20'" in refusal(write_mat(path, [ROW], vel=20))
    cell = np.empty((1, 1), object)
    cell[0, 0] = np.array([10.0, 20.0])
    assert "vel is '[10. 20.]'" in refusal(write_mat(path, [ROW], vel=cell))
