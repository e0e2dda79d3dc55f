"""Somebody's own pushes as a store: what is kept, and what is refused with its row."""

import json
import os
import re
import sys
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

from datasets.own_pushes import (
    HEADER,
    PROPERTIES,
    SPEED,
    at,
    pusher_at,
    rows,
    to_csv,
    to_parquet,
    write,
)
from datasets.stores import assert_same_files, contents
from sainet.cli.entry import run
from sainet.datasets.batch import to_batch
from sainet.datasets.recorded.own import import_table
from sainet.runs.errors import BadInput, BadTable, MissingExtra, RunConflict
from support import require

WITHIN = np.arange(1, 97) / 240  # s
GROUPED = [*HEADER, "group"]


@pytest.fixture(scope="module")
def imported(tmp_path_factory: pytest.TempPathFactory):
    """A push at 250 Hz and a shorter one at 30 Hz, rows of both and of bodies mixed."""
    folder = tmp_path_factory.mktemp("table")
    fast = [[*row, "rubber"] for row in rows("first")]
    slow = [[*row, "wood"] for row in rows("second", 30, 0.3)]
    mixed = [
        row for k in range(len(fast)) for row in (*fast[k : k + 1], *slow[k : k + 1])
    ]
    return import_table(*write(folder / "in", to_csv(mixed, GROUPED)), folder / "out")


def test_imported_motion_equals_the_recorded_motion(imported):
    arrays = imported.read(slice(None))
    for push, steps in enumerate((96, 72)):
        for body, name in enumerate(("far", "near")):  # the order of the TOML
            found = arrays["truth"][push, :steps, body, :3]
            wanted = at(name, WITHIN[:steps])
            np.testing.assert_allclose(found[:, :2], wanted[:, :2], atol=1e-6)
            np.testing.assert_allclose(found[:, 2], wanted[:, 2], atol=1e-5)
            start = at(name, np.zeros(1))[0]
            initial = arrays["initial"][push, body]
            np.testing.assert_allclose(initial[:3], start, atol=1e-6)
            assert not initial[3:].any()
        command = arrays["command_position"][push, :steps]
        np.testing.assert_allclose(command, pusher_at(WITHIN[:steps]), atol=1e-6)
        assert arrays["pose_observed"][push].sum() == steps
        assert np.isnan(arrays["truth"][push, steps:]).all()
    rate, known = arrays["truth"][0, :, 0, 3], arrays["rate_observed"][0] > 0
    assert known.sum() == 96 - 24
    np.testing.assert_allclose(rate[known], SPEED["far"], rtol=1e-4)


def test_the_store_has_the_values_of_the_properties_file(imported):
    info = imported.info
    assert (info.kind, info.engine, info.bodies) == ("robot", "recorded", 2)
    assert info.groups == ("rubber", "wood")
    arrays = imported.read(slice(None))
    assert arrays["steps"].tolist() == [120, 80]  # whole buckets, the rest held
    assert arrays["group"].tolist() == [0, 1]
    for name, value in {
        **{"mass": [1.0, 0.5], "radius": [0.05, 0.04], "pusher_radius": 0.005},
        **{"table_friction": 0.3, "disk_friction": 0.2, "pusher_friction": 0.2},
    }.items():
        np.testing.assert_allclose(arrays[name] - np.float32(value), 0, atol=1e-7)
    batch = to_batch(arrays, info, simulated="planar-true")
    assert int(batch.pose_observed.sum()) == 96 + 72
    config = json.loads((imported.path / "config.json").read_text())
    assert config["bodies"] == ["far", "near"]


def test_long_gaps_are_not_interpolated(tmp_path: Path):
    table, bodies = write(tmp_path, to_csv(rows(rate=2.5, duration=2.0)))
    arrays = import_table(table, bodies, tmp_path / "out").read(slice(None))
    seen = np.flatnonzero(arrays["pose_observed"][0])
    around = {k + side - 1 for k in range(0, 481, 96) for side in (-1, 0, 1)}
    assert seen.tolist() == sorted(around - {-2, -1, 480})
    assert not arrays["rate_observed"].any()


def test_angles_may_be_wrapped_and_frictions_left_out(tmp_path: Path):
    wrapped = [[*r[:5], (r[5] + np.pi) % (2 * np.pi) - np.pi, *r[6:]] for r in rows()]
    spare = PROPERTIES.partition("[friction]")[0] + "[bodies.spare]\nmass=1\nradius=1\n"
    table, bodies = write(tmp_path, "\ufeff" + to_csv(wrapped), spare)
    store = import_table(table, bodies, tmp_path / "out", contact_friction=0.4)
    arrays = store.read(slice(None))
    angle = arrays["truth"][0, :96, 1, 2]
    np.testing.assert_allclose(angle, at("near", WITHIN)[:, 2], atol=1e-5)
    assert store.info.bodies == 2
    assert arrays["table_friction"] == pytest.approx(0.15)
    assert arrays["pusher_friction"] == pytest.approx(0.4)


def test_equal_input_gives_equal_bytes_and_other_input_is_refused(
    tmp_path: Path,
):
    table, bodies = write(tmp_path / "in", to_csv(rows()))
    for out in ("one", "two", "two"):
        import_table(table, bodies, tmp_path / out)
    assert_same_files(tmp_path / "one", tmp_path / "two")
    before = contents(tmp_path / "one")
    bodies.write_text(PROPERTIES.replace("0.04", "0.039"))
    with pytest.raises(RunConflict, match="radius"):
        import_table(table, bodies, tmp_path / "one")
    assert contents(tmp_path / "one") == before


def change(row: int, column: str, value):
    """A table with one value changed; row 2 is the first below the header."""
    table = rows()
    table[row - 2][HEADER.index(column)] = value
    return to_csv(table)


def each(column: str, factor: float):
    table = rows()
    for row in table:
        row[HEADER.index(column)] *= factor
    return to_csv(table)


def swapped(one: int, other: int) -> str:
    table = rows()
    table[one - 2], table[other - 2] = table[other - 2], table[one - 2]
    return to_csv(table)


def in_groups(column: str = "group") -> str:
    return to_csv([[*r, k > 7] for k, r in enumerate(rows())], [*HEADER, column])


HOSTILE = {
    "empty": ("", "pushes.csv: empty"),
    "header alone": (to_csv([]), "has no rows"),
    "no text": (b"\xff\xfe\0", "not CSV text"),
    "missing column": (
        to_csv([[*r[:5], *r[6:]] for r in rows()], [*HEADER[:5], *HEADER[6:]]),
        "row 1: column angle is missing",
    ),
    "column twice": (
        to_csv([[*r, 0] for r in rows()], [*HEADER, "x"]),
        "row 1: column x is there twice",
    ),
    "unknown column": (
        to_csv([[*r, 0] for r in rows()], [*HEADER, "z"]),
        "row 1: column z is unknown",
    ),
    "row numbers of pandas": (
        to_csv([[0, *r] for r in rows()], ["", *HEADER]),
        r"row 1: column \(unnamed\) is unknown",
    ),
    "decimal comma": (
        change(9, "y", '"0,2"'),
        "row 9: y is '0,2'; it must be a finite number: write a decimal point",
    ),
    "cut row": (to_csv(rows())[:-30], "row 203: has .* fields, not 8"),
    "decimal commas": (change(9, "y", "0,2"), "row 9: has 9 .* has decimal commas"),
    "no number": (
        change(9, "y", "left"),
        "row 9: y is 'left'; it must be a finite number",
    ),
    "underscore": (
        change(9, "x", "0_2"),
        "row 9: x is '0_2'; it must be a finite number",
    ),
    "empty field": (change(9, "y", ""), "row 9: y is ''; it must be a finite number"),
    "nan": (change(10, "x", "nan"), "row 10: x is 'nan'; it must be a finite number"),
    "infinite": (change(10, "time", "1e999"), "row 10: time is '1e999'"),
    "no push": (change(4, "push", " "), "row 4: push is empty"),
    "unknown body": (
        change(7, "body", "mid"),
        "row 7: body 'mid' has no properties; add .* to .*bodies.toml",
    ),
    "backwards": (
        swapped(20, 22),
        "row 22: push '1': .* comes after .* give each push its own name",
    ),
    "repeated": (change(22, "time", 0.036), "row 22: .* appears twice"),
    "duplicate row": (to_csv([*rows(), rows()[-1]]), "row 204: .* appears twice"),
    "body missing": (
        to_csv(rows() + [r for r in rows("b") if r[2] == "far"]),
        "row 204: push 'b': body 'near' is missing",
    ),
    "body missing at a time": (
        to_csv(rows()[:100] + rows()[101:]),
        r"row 102: push '1': body 'near' is missing at time 0\.2; add its row, or rem",
    ),
    "body at another time": (
        to_csv(rows()[:101] + rows()[102:]),
        r"row 102: push '1': another body is missing at time 0\.2; add its row, or",
    ),
    "pusher in two places": (
        change(15, "pusher_x", 0.2),
        "row 14: push '1': the pusher is elsewhere",
    ),
    "jump": (change(100, "x", 0.25), "row 100: push '1': the body jumps by .* m in 0"),
    "jump of the pusher": (
        to_csv([[*r[:6], r[6] - 0.05 * (r[1] > 0.195), r[7]] for r in rows()]),
        "row 100: push '1': the pusher jumps by .* m in 0",
    ),
    "jump of the angle": (
        change(100, "angle", 2.5),
        "row 100: .*: the angle jumps by 0.638 rad in 0.004 s",
    ),
    "millimetres": (
        each("y", 1000),
        "y is 100 .in millimetres.*; it must be from -5 to 5 m; in another unit, give",
    ),
    "pusher in millimetres": (
        each("pusher_x", 1000),
        "pusher_x is .*in millimetres",
    ),
    "degrees": (each("angle", 57.3), "angle is .*in degrees.*; it must be .* rad"),
    "milliseconds": (
        each("time", 1000),
        "lasts 400 s .in milliseconds.*; .* in seconds",
    ),
    "one sample": (to_csv(rows()[:2]), "row 3: push '1': has fewer than two samples"),
    "too short": (to_csv(rows(rate=5000)[:4]), "push '1': lasts less than a step"),
    "groups": (in_groups(), "row .*: push '1' is in several groups"),
    "kinds": (in_groups("kind"), "row .*: push '1' is in several kinds"),
}


def test_pushes_of_one_kind_are_repeats(tmp_path: Path):
    """Unless their groups differ."""
    kinds = {"1": "left", "2": "right", "3": "left", "4": "left"}
    table = [
        [*row, kind, "wood" if push == "4" else "felt"]
        for push, kind in kinds.items()
        for row in rows(push, 30, 0.3)
    ]
    text = to_csv(table, [*HEADER, "kind", "group"])
    store = import_table(*write(tmp_path, text), tmp_path / "out")
    one, two, three, four = store.take([0, 1, 2, 3]).read(slice(None), ("repeat",))[
        "repeat"
    ]
    assert one == three
    assert len({one, two, four}) == 3


@pytest.mark.parametrize("case", HOSTILE)
def test_hostile_tables_give_one_line_with_the_row_and_leave_nothing(
    tmp_path: Path, case: str
):
    text, wanted = HOSTILE[case]
    table, bodies = write(tmp_path, text)
    with pytest.raises(BadTable, match=wanted) as caught:
        import_table(table, bodies, tmp_path / "out")
    assert str(caught.value).startswith(f"{table}: ")
    assert len(str(caught.value).splitlines()) == 1
    assert sorted(p.name for p in tmp_path.iterdir()) == ["bodies.toml", "pushes.csv"]


def test_what_no_dataset_can_hold_leaves_nothing(tmp_path: Path):
    grouped = [[*row, "g" * 201] for row in rows()]
    far = [
        [*row[:2], f"b{k}", 1 + 0.01 * k, 0, 0, *row[6:]]
        for k in range(101)
        for row in rows(rate=30)[::2]
    ]
    bodies = "".join(f"[bodies.b{k}]\nmass=1\nradius=0.004\n" for k in range(101))
    tip = "[pusher]\nradius=0.005\n"
    for table, header, properties, says in (
        (grouped, GROUPED, PROPERTIES, "groups.*length <= 200"),
        (far, HEADER, bodies + tip, "bodies: expected `int` <= 100"),
    ):
        paths = write(tmp_path, to_csv(table, header), properties)
        with pytest.raises(BadInput, match=f"^pushes.csv: {says}"):
            import_table(*paths, tmp_path / "out")
        assert not (tmp_path / "out").exists()


def test_degrees_of_small_rotations_are_recognised(tmp_path: Path):
    """Ten degrees, given as ten: never beyond twenty, and no sample jumps."""
    table = rows(duration=1.0)
    for k, row in enumerate(table):
        row[5] = 10 * k / len(table)
    with pytest.raises(BadTable, match=r"row 3: .* changes by .* .in degrees"):
        import_table(*write(tmp_path, to_csv(table)), tmp_path / "out")


BAD_PROPERTIES = {
    "no toml": ("[bodies", "not TOML"),
    "no bodies": ("[pusher]\nradius=1\n", r"\[bodies\] is missing"),
    "no pusher": (PROPERTIES.replace("pusher", "bodies.p"), r"\[pusher\] is missing"),
    "no mass": (
        PROPERTIES.replace("mass = 1.0", ""),
        r"\[bodies.'far'\] mass is missing",
    ),
    "negative": (
        PROPERTIES.replace("1.0", "-1.0"),
        "mass is -1; it must be from 0.001 to 100 kg",
    ),
    "huge": (PROPERTIES.replace("1.0", "9" * 400), "mass is inf .*it must be from"),
    "text": (PROPERTIES.replace("1.0", "'1'"), "mass is '1'; it must be from"),
    "truth": (PROPERTIES.replace("1.0", "true"), "mass is True; it must be from"),
    "nan": (PROPERTIES.replace("0.05", "nan"), "radius is nan; it must be from"),
    "millimetres": (PROPERTIES.replace("0.05", "52.5"), "in millimetres"),
    "grams": (PROPERTIES.replace("1.0", "896"), "in grams"),
    "unknown field": (
        PROPERTIES.replace("mass", "weight", 1),
        "unknown field 'weight'",
    ),
    "unknown section": (PROPERTIES + "[robot]\na=1\n", "unknown field 'robot'"),
    "friction": (
        PROPERTIES.replace("0.3", "-0.3"),
        "table is -0.3; it must",
    ),
}


@pytest.mark.parametrize("case", BAD_PROPERTIES)
def test_bad_properties_are_named(tmp_path: Path, case: str):
    text, wanted = BAD_PROPERTIES[case]
    table, bodies = write(tmp_path, to_csv(rows()), text)
    with pytest.raises(BadTable, match=wanted) as caught:
        import_table(table, bodies, tmp_path / "out")
    for line in str(caught.value).splitlines():
        assert line.startswith(f"{bodies}: ")
    assert not (tmp_path / "out").exists()


def typical_mistakes() -> tuple[str, str]:
    """A table and properties with the mistakes of a first import."""
    table = [[*row[:5], np.rad2deg(row[5]), *row[6:]] for row in rows("a")]
    table += [[*row[:3], 1000 * row[3], *row[4:]] for row in rows("b")]
    table += [[row[0], 1000 * row[1], *row[2:]] for row in rows("c")]
    table += rows("d")[::-1]
    table += rows("e")
    table[-5][4] = "nan"
    text = to_csv(table).replace(",", ";")
    weighed = PROPERTIES.replace("mass = 1.0", "mass = 896").replace("0.005", "5")
    return text, weighed


def test_one_run_reports_every_kind_of_typical_mistake(tmp_path: Path, capfd):
    text, properties = typical_mistakes()
    table, bodies = write(tmp_path, text, properties)
    words = ["import", "table", str(table), "--properties", str(bodies)]
    assert run([*words, "--out", str(tmp_path / "out")]) == 2
    lines = capfd.readouterr().err.splitlines()
    wanted = [
        r"pushes.csv: row 1: semicolons separate the columns; use commas",
        r"pushes.csv: row \d+: y is 'nan'; it must be a finite number",
        r"bodies.toml: \[bodies.'far'\] mass is 896 \(in grams\?\)",
        r"bodies.toml: \[pusher\] radius is 5 \(in millimetres\?\)",
        r"pushes.csv: row \d+: x is .* \(in millimetres\?\)",
        r"pushes.csv: row \d+: angle is .* \(in degrees\?\)",
        r"pushes.csv: row \d+: push 'c': lasts 400 s \(in milliseconds\?\)",
        r"pushes.csv: row \d+: push 'd': body 'far': time .* sort the times",
    ]
    assert len(lines) == len(wanted)
    for line, pattern in zip(lines, wanted, strict=True):
        assert line.startswith(f"sainet: {tmp_path}/")
        assert re.search(pattern, line)
    assert not (tmp_path / "out").exists()


def test_a_misnamed_column_is_reported_with_the_units_of_the_others(tmp_path: Path):
    text = each("y", 1000).replace("angle", "angel")
    with pytest.raises(BadTable) as caught:
        import_table(*write(tmp_path, text), tmp_path / "out")
    missing, unknown, millimetres = caught.value.problems
    assert "column angle (is it 'angel'?) is missing" in missing
    assert "column angel is unknown" in unknown
    assert "y is 100 (in millimetres?)" in millimetres


def test_columns_in_other_letters_are_recognised_in_messages(tmp_path: Path):
    head, _, body = to_csv(rows()).partition("\n")
    with pytest.raises(BadTable) as caught:
        import_table(*write(tmp_path, f"{head.title()}\n{body}"), tmp_path / "out")
    for name in HEADER:
        assert f"{name} (is it {name.title()!r}?)" in caught.value.problems[0]


def test_a_disk_far_from_the_pusher_is_refused(tmp_path: Path):
    table = rows()
    for row in table:
        row[7] += 1.0
    with pytest.raises(
        BadTable, match=r"row 3: push '1': 'near' moves .* untouched|away"
    ):
        import_table(*write(tmp_path, to_csv(table)), tmp_path / "out")


def test_pipes_and_devices_are_refused(tmp_path: Path):
    _, bodies = write(tmp_path, to_csv(rows()))
    os.mkfifo(tmp_path / "pipe.csv")
    os.mkfifo(tmp_path / "pipe.toml")
    (tmp_path / "zero.csv").symlink_to("/dev/zero")
    for path in ("pipe.csv", "zero.csv"):
        with pytest.raises(BadTable, match="not a regular file"):
            import_table(tmp_path / path, bodies, tmp_path / "out")
    with pytest.raises(BadTable, match="pipe.toml: not a regular file"):
        import_table(tmp_path / "pushes.csv", tmp_path / "pipe.toml", tmp_path / "out")


@pytest.mark.parametrize("radius", ["0.057", "0.06"])
def test_disks_that_overlap_have_a_wrong_radius(tmp_path: Path, radius: str):
    """The disks are 100 mm apart, their radii sum up to 90."""
    larger = PROPERTIES.replace("0.05\n", f"{float(radius) + 0.01}\n")
    table, bodies = write(tmp_path, to_csv(rows()), larger)
    with pytest.raises(BadTable, match=r"'far' and 'near' overlap by .* radii"):
        import_table(table, bodies, tmp_path / "out")


def test_unusable_files_and_frictions_are_refused(tmp_path: Path):
    table, bodies = write(tmp_path, to_csv(rows()))
    for path in (tmp_path / "no.csv", tmp_path, tmp_path / "no.parquet"):
        with pytest.raises(BadTable, match=str(path)):
            import_table(path, bodies, tmp_path / "out")
    with pytest.raises(BadTable, match="no.toml: no such file"):
        import_table(table, tmp_path / "no.toml", tmp_path / "out")
    with pytest.raises(BadInput, match="`contact_friction` is -1"):
        import_table(table, bodies, tmp_path / "out", contact_friction=-1)
    assert not (tmp_path / "out").exists()


def needs_parquet() -> None:
    require(find_spec("pyarrow"), "pyarrow is missing: pip install 'sainet[table]'")


def as_parquet(tmp_path: Path, data: bytes) -> tuple[Path, Path]:
    _, bodies = write(tmp_path, "")
    path = tmp_path / "pushes.parquet"
    path.write_bytes(data)
    return path, bodies


def test_parquet_and_csv_give_equal_stores(tmp_path: Path):
    needs_parquet()
    table = [[*row, "wood"] for row in rows("7") + rows("3")]
    one = import_table(*write(tmp_path, to_csv(table, GROUPED)), tmp_path / "one")
    numbered = [[int(row[0]), *row[1:]] for row in table]
    for form, written in {"text": table, "numbers": numbered}.items():
        path, bodies = as_parquet(tmp_path, to_parquet(written, GROUPED))
        other = import_table(path, bodies, tmp_path / form).read(slice(None))
        for name, value in one.read(slice(None)).items():
            np.testing.assert_array_equal(other[name], value, err_msg=name)


def without(column: int, row: int = 4) -> list[list]:
    table = rows()
    table[row - 1][column] = None
    return table


HOSTILE_PARQUET = {
    "damaged": (lambda: to_parquet(rows())[:-40], "damaged or not a Parquet file"),
    "empty": (lambda: b"", "damaged or not a Parquet file"),
    "no rows": (lambda: to_parquet([]), "column .* contains null|has no rows"),
    "missing": (lambda: to_parquet(rows(), HEADER[:-1]), "column pusher_y is missing"),
    "unknown": (
        lambda: to_parquet([[*r, 0] for r in rows()], [*HEADER, "__index_level_0__"]),
        "__index_level_0__ is unknown",
    ),
    "null": (lambda: to_parquet(without(3)), "row 4: x is nan"),
    "no push": (lambda: to_parquet(without(0)), "row 4: push is empty"),
    "text": (
        lambda: to_parquet([[*r[:3], str(r[3]), *r[4:]] for r in rows()]),
        "column x contains string, not numbers",
    ),
    "lists": (
        lambda: to_parquet([[[1], *r[1:]] for r in rows()]),
        "column push contains list.*, not text",
    ),
}


@pytest.mark.parametrize("case", HOSTILE_PARQUET)
def test_hostile_parquet_gives_one_line(tmp_path: Path, case: str):
    needs_parquet()
    make, wanted = HOSTILE_PARQUET[case]
    path, bodies = as_parquet(tmp_path, make())
    with pytest.raises(BadTable, match=wanted) as caught:
        import_table(path, bodies, tmp_path / "out")
    assert len(str(caught.value).splitlines()) == 1
    assert not (tmp_path / "out").exists()


def test_without_pyarrow_the_message_names_the_extra(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(MissingExtra, match=r"pip install 'sainet\[table\]'"):
        import_table(*as_parquet(tmp_path, b"PAR1"), tmp_path / "out")
