"""A model is refused on its training pushes, wherever they are stored."""

from pathlib import Path

import numpy as np
import pytest

from datasets.own_pushes import PROPERTIES, rows, to_csv, write
from sainet.cli.entry import run
from sainet.datasets.recorded.own import import_table
from sainet.datasets.recorded.units import Units
from sainet.datasets.splits import write_split
from sainet.datasets.store import open_store
from sainet.runs.digests import digests_to_text, pushes_overlap

PUSHES = 8


def table() -> list[list]:
    """Pushes that differ in where they are, with four decimals."""
    found = []
    for push in range(PUSHES):
        for name, time, body, *numbers in rows(f"push {push}", duration=0.2):
            x, y, angle, px, py = (round(value, 4) for value in numbers)
            shift = round(0.003 * push, 4)
            aside = round(0.001 * push, 4)  # another contact angle
            line = [name, time, body, x, y + shift, angle, px, py + shift + aside]
            found.append(line)
    return found


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory):
    folder = tmp_path_factory.mktemp("whole")
    return import_table(*write(folder / "in", to_csv(table())), folder / "data")


def shuffled(lines: list[list]) -> list[list]:
    """Pushes in another order, under other names, their bodies in another order."""
    pushes = [[r for r in lines if r[0] == f"push {k}"] for k in range(PUSHES)]
    return [[f"run {r[0][5:]}", *r[1:]] for push in pushes[::-1] for r in push]


def in_millimetres(lines: list[list]) -> list[list]:
    return [
        [*r[:3], *(f"{1000 * v:.1f}" for v in r[3:5]), r[5]]
        + [f"{1000 * v:.1f}" for v in r[6:]]
        for r in lines
    ]


def a_turn_away(lines: list[list]) -> list[list]:
    return [[*r[:5], r[5] - 2 * np.pi, *r[6:]] for r in lines]


IMPORTS = {
    "another turn of the angles": (a_turn_away, PROPERTIES, Units()),
    "another order and other names": (shuffled, PROPERTIES, Units()),
    "other masses and frictions": (
        list,
        PROPERTIES.replace("1.0", "1.2").replace("0.3", "0.2"),
        Units(),
    ),
    "another unit": (in_millimetres, PROPERTIES, Units(length_unit="mm")),
}


@pytest.mark.parametrize("case", IMPORTS)
def test_another_import_contains_the_same_pushes(tmp_path: Path, whole, case: str):
    change, properties, units = IMPORTS[case]
    text = to_csv(change(table()))
    other = import_table(
        *write(tmp_path / "in", text, properties), tmp_path / "out", units=units
    )
    assert set(other.push_hashes()) == set(whole.push_hashes())


def test_other_pushes_have_other_hashes(tmp_path: Path, whole):
    """A tenth of a millimetre is enough, of one disk at the start."""
    moved = [[*r[:4], r[4] + 1e-4 * (r[2] == "far"), *r[5:]] for r in table()]
    other = import_table(*write(tmp_path / "in", to_csv(moved)), tmp_path / "out")
    assert not set(other.push_hashes()) & set(whole.push_hashes())


def test_parts_share_no_hash_and_a_part_of_a_part_is_recognised(tmp_path: Path, whole):
    train, tests = write_split(whole, tmp_path / "parts", test=0.25, seed=3)
    seen = digests_to_text(train.first(4).push_hashes())
    assert pushes_overlap(seen, tests.push_hashes()) == 0
    assert pushes_overlap(seen, train.push_hashes()) == 4
    assert pushes_overlap(seen, whole.push_hashes()) == 4
    again, _ = write_split(train, tmp_path / "again", test=0.3, seed=0)
    known = np.isin(again.push_hashes(), train.first(4).push_hashes()).sum()
    assert pushes_overlap(seen, again.push_hashes()) == known > 0


@pytest.mark.slow
def test_a_process_is_refused_on_its_pushes_in_any_dataset(
    tmp_path: Path, whole, capfd: pytest.CaptureFixture[str]
):
    parts, out = tmp_path / "parts", tmp_path / "model"
    words = ["split", "--data", str(whole.path), "--out", str(parts), "--quiet"]
    assert run([*words, "--test", "0.25"]) == 0
    words = ["tune", "gp", "--data", str(parts / "train"), "--out", str(out)]
    assert run([*words, "--pushes", "5", "--engine", "planar", "--quiet"]) == 0
    path, bodies = write(tmp_path / "in", to_csv(in_millimetres(shuffled(table()))))
    words = ["import", "table", str(path), "--properties", str(bodies)]
    again = tmp_path / "again"
    words += ["--out", str(again), "--length-unit", "mm", "--contact-friction", "0.3"]
    assert run([*words, "--quiet"]) == 0
    capfd.readouterr()
    words = ["evaluate", "--model", str(out), "--quiet", "--json", "--data"]
    for data, pushes in ((whole.path, 8), (parts / "train", 6), (again, 8)):
        assert run([*words, str(data)]) == 2
        assert f"trained on 5 of these {pushes} pushes" in capfd.readouterr().err
    assert run([*words, str(parts / "test")]) == 0
    assert open_store(parts / "test").info.pushes == 2


def test_an_identified_engine_is_refused_on_its_own_pushes(
    whole, tmp_path: Path, capsys
):
    known = write_split(open_store(whole.path), tmp_path / "parts", test=0.25)
    out = tmp_path / "identified"
    store = ["--data", str(known[0].path), "--quiet"]
    assert run(["identify", *store, "--out", str(out)]) == 0
    capsys.readouterr()
    assert run(["evaluate", "--model", str(out), "--data", str(whole.path)]) == 2
    error = capsys.readouterr().err
    assert f"{out}/identified.json: the engine was identified on 6 of these 8" in error
    words = ["evaluate", "--model", str(out), "--data", str(known[1].path)]
    assert run(words) == 0
    assert run(["evaluate", "--model", str(out), *store, "--force"]) == 0
