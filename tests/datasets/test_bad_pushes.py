"""Tables with bad pushes: every problem at once, or leave the pushes out; units."""

import json
from pathlib import Path

import numpy as np
import pytest

from datasets.own_pushes import HEADER, PROPERTIES, rows, to_csv, to_parquet, write
from datasets.stores import contents
from sainet.cli.entry import run
from sainet.datasets.recorded.own import import_table
from sainet.datasets.recorded.problems import MOST_PROBLEMS
from sainet.datasets.recorded.units import Units
from sainet.datasets.store import open_store
from sainet.runs.errors import BadTable, RunConflict

ROWS = len(rows())


def changed(push: str, row: int, column: str, value) -> list[list]:
    """The rows of a push, one value of which is changed."""
    table = rows(push)
    table[row][HEADER.index(column)] = value
    return table


def line_of(push: int, row: int) -> int:
    """The line of a file at which a row of the push with this index is."""
    return 2 + push * ROWS + row


BAD = {
    "nan": changed("nan", 50, "y", "nan"),
    "text": changed("text", 60, "angle", "left"),
    "nobody": changed("nobody", 70, "body", ""),
    "far": changed("far", 80, "x", 1e6),
    "turned": changed("turned", 90, "angle", 99),
    "jumps": changed("jumps", 100, "x", 0.25),
    "backwards": rows("backwards")[::-1],
    "half": [row for row in rows("half") if row[2] == "far"],
    "two pushers": changed("two pushers", 12, "pusher_x", 0.2),
}


def mixed() -> list[list]:
    """Good pushes between bad pushes."""
    found = rows("good 0")
    for number, table in enumerate(BAD.values(), start=1):
        found += [*table, *rows(f"good {number}", duration=0.4 + number / 50)]
    return found


def good() -> list[list]:
    return [row for row in mixed() if row[0].startswith("good")]


def arrays_of(folder: Path) -> dict[str, np.ndarray]:
    return open_store(folder).read(slice(None))


def test_every_bad_push_is_reported_at_once(tmp_path: Path):
    with pytest.raises(BadTable) as caught:
        import_table(*write(tmp_path, to_csv(mixed())), tmp_path / "out")
    *lines, last = caught.value.problems
    assert len(lines) == len(BAD)
    good = f"{len(BAD) + 1} have no problem."
    assert last == f"Give `skip_bad` to leave bad pushes out; {good}"
    text = "\n".join(lines)
    wanted = ["y is 'nan'", "angle is 'left'", "body is empty", "x is 1e+06 (in mi"]
    wanted += ["angle is 99 (in deg", "the body jumps", "sort the times"]
    wanted += ["body 'near' is missing", "the pusher is elsewhere"]
    for each in wanted:
        assert each in text
    assert all(line.startswith(f"{tmp_path}/pushes.csv: row ") for line in lines)


def test_rows_of_one_kind_are_listed_and_the_rest_counted(tmp_path: Path):
    table = [
        *rows("good"),
        *(r for k in range(30) for r in changed(f"{k}", 9, "y", "?")),
    ]
    table += BAD["jumps"]
    with pytest.raises(BadTable) as caught:
        import_table(*write(tmp_path, to_csv(table)), tmp_path / "out")
    lines = caught.value.problems
    assert len(lines) == MOST_PROBLEMS + 1
    assert lines[-1] == "and 11 more problems."
    # The first of each kind comes first, so that none is hidden behind many others.
    assert f"row {line_of(1, 9)}: y is '?'" in lines[0]
    assert "jumps" in lines[1]
    assert f"row {line_of(2, 9)}: y is '?'" in lines[2]


def test_skipping_bad_pushes_gives_the_dataset_of_the_others(tmp_path: Path, caplog):
    one = import_table(
        *write(tmp_path / "a", to_csv(mixed())), tmp_path / "one", skip_bad=True
    )
    other = import_table(*write(tmp_path / "b", to_csv(good())), tmp_path / "other")
    assert one.info.pushes == len(BAD) + 1
    wanted = arrays_of(other.path)
    for name, found in arrays_of(one.path).items():
        np.testing.assert_array_equal(found, wanted[name])
    assert f"{len(BAD)} of {2 * len(BAD) + 1} pushes left out" in caplog.text
    assert caplog.text.count("pushes.csv: row ") == len(BAD)


@pytest.mark.parametrize("form", ["csv", "parquet"])
def test_a_push_without_a_number_is_left_out_of_either_format(tmp_path: Path, form):
    pytest.importorskip("pyarrow")
    table = [*rows("good"), *changed("bad", 3, "x", float("nan"))]
    path, bodies = write(tmp_path, to_csv(table))
    if form == "parquet":
        path = tmp_path / "pushes.parquet"
        path.write_bytes(to_parquet(table))
    with pytest.raises(BadTable, match="x is '?nan"):
        import_table(path, bodies, tmp_path / "out")
    store = import_table(path, bodies, tmp_path / "out", skip_bad=True)
    assert store.info.pushes == 1


@pytest.mark.parametrize("column", ["push", "body", "group"])
@pytest.mark.parametrize("empty", [" ", None])
def test_an_empty_text_costs_only_its_push_in_parquet_too(tmp_path, column, empty):
    pytest.importorskip("pyarrow")
    header = [*HEADER, "group"]
    table = [[*row, "felt"] for push in ("good", "bad") for row in rows(push)]
    table[-3][header.index(column)] = empty
    _, bodies = write(tmp_path, "")
    path = tmp_path / "pushes.parquet"
    path.write_bytes(to_parquet(table, header))
    says = f"^{path}: row {len(table) - 2}: {column} is empty; write its name.$"
    for skip in (False, True) if column == "push" else (False,):
        with pytest.raises(BadTable, match=says):
            import_table(path, bodies, tmp_path / "out", skip_bad=skip)
    if column != "push":
        store = import_table(path, bodies, tmp_path / "out", skip_bad=True)
        assert store.info.pushes == 1


@pytest.mark.parametrize(
    "characters", range(2, len(",".join(map(str, rows()[-1][:-1]))), 4)
)
def test_a_logger_that_stopped_within_a_row_costs_only_its_push(
    tmp_path: Path, characters: int
):
    """However much of the last row is there, the push before it is not touched."""
    last = to_csv([rows()[-1]]).splitlines()[1]
    text = to_csv([*rows("good"), *rows()[:-1]]) + last[:characters]
    store = import_table(*write(tmp_path, text), tmp_path / "out", skip_bad=True)
    assert store.info.pushes == 1
    assert arrays_of(store.path)["steps"].tolist() == [120]


NEVER_SKIPPED = {
    "a column is missing": (
        to_csv([[*r[:5], *r[6:]] for r in mixed()], [*HEADER[:5], *HEADER[6:]]),
        "angle is missing",
    ),
    "a row of no push": (to_csv([*good(), *changed(" ", 3, "x", 0)]), "push is empty"),
    "a row that is too long": (to_csv([*good(), [*rows()[0], 1]]), "has 9 fields"),
    "a row with half the name of its push": (to_csv(good()) + "go", "has 1 fields"),
    "an unknown body": (to_csv([*good(), *changed("x", 3, "body", "mid")]), "no prop"),
    "no good push": (to_csv(BAD["nan"]), "y is 'nan'"),
}


@pytest.mark.parametrize("case", NEVER_SKIPPED)
def test_problems_of_the_whole_file_are_never_skipped(tmp_path: Path, case: str):
    text, wanted = NEVER_SKIPPED[case]
    with pytest.raises(BadTable, match=wanted):
        import_table(*write(tmp_path, text), tmp_path / "out", skip_bad=True)
    assert not (tmp_path / "out").exists()


def in_units(table: list[list]) -> list[list]:
    """The same rows in mm, degrees and ms, with all digits."""
    return [
        [
            push,
            1000 * time,
            body,
            1000 * x,
            1000 * y,
            np.rad2deg(angle),
            1000 * px,
            1000 * py,
        ]
        for push, time, body, x, y, angle, px, py in table
    ]


def test_other_units_give_the_same_pushes(tmp_path: Path):
    one = import_table(*write(tmp_path / "a", to_csv(rows())), tmp_path / "one")
    units = Units(length_unit="mm", angle_unit="deg", time_unit="ms")
    path, bodies = write(tmp_path / "b", to_csv(in_units(rows())))
    other = import_table(path, bodies, tmp_path / "other", units=units)
    wanted = arrays_of(one.path)
    for name, found in arrays_of(other.path).items():
        np.testing.assert_allclose(found, wanted[name], rtol=1e-4, atol=2e-6)
    with pytest.raises(BadTable, match="in millimetres"):
        import_table(path, bodies, tmp_path / "third")
    with pytest.raises(RunConflict, match="angle_unit is deg"):
        import_table(tmp_path / "a" / "pushes.csv", bodies, tmp_path / "other")


def test_millimetres_in_a_file_of_decimals_give_the_same_hashes(tmp_path: Path):
    """A model is refused on its training pushes also if their unit changes."""
    text = [[r[0], r[1], r[2], *(f"{v:.4f}" for v in r[3:])] for r in rows()]
    scaled = [
        [*r[:3], *(f"{1000 * float(v):.1f}" for v in r[3:5]), r[5]]
        + [f"{1000 * float(v):.1f}" for v in r[6:]]
        for r in text
    ]
    one = import_table(*write(tmp_path / "a", to_csv(text)), tmp_path / "one")
    path, bodies = write(tmp_path / "b", to_csv(scaled))
    other = import_table(
        path, bodies, tmp_path / "other", units=Units(length_unit="mm")
    )
    assert (one.push_hashes() == other.push_hashes()).all()


def test_the_command_counts_what_it_left_out(tmp_path: Path, capfd):
    path, bodies = write(tmp_path, to_csv(in_units(mixed()[:ROWS] + rows("b"))))
    words = ["import", "table", str(path), "--properties", str(bodies)]
    words += ["--out", str(tmp_path / "out"), "--length-unit", "mm", "--json"]
    words += ["--angle-unit", "deg", "--time-unit", "ms"]
    text = path.read_text().replace("b,0.0,far", "b,soon,far")
    path.write_text(text)
    assert run(words) == 2
    assert "time is 'soon'" in capfd.readouterr().err
    for _ in range(2):
        assert run([*words, "--skip-bad"]) == 0
        found = json.loads(capfd.readouterr().out)
        assert (found["pushes"], found["left_out"]) == (1, 1)
    before = contents(tmp_path / "out")
    assert run(words) == 2
    assert contents(tmp_path / "out") == before


@pytest.mark.parametrize("option", ["--length-unit=mm", "--time-unit=ms", "--skip-bad"])
def test_options_of_tables_are_refused_for_other_formats(tmp_path: Path, capfd, option):
    words = ["import", "mitpush-endpoints", "x.csv", "--out", str(tmp_path / "out")]
    assert run([*words, option]) == 2
    error = capfd.readouterr().err
    assert error.startswith(
        f"sainet: {option.partition('=')[0]} is for the format table"
    )


def test_problems_of_the_properties_are_never_skipped(tmp_path: Path):
    properties = PROPERTIES.replace("mass = 1.0", "mass = -1")
    with pytest.raises(BadTable, match=r"mass is -1; it must be") as caught:
        import_table(
            *write(tmp_path, to_csv(mixed()), properties),
            tmp_path / "out",
            skip_bad=True,
        )
    assert len(caught.value.problems) == len(BAD) + 1
    assert not (tmp_path / "out").exists()
