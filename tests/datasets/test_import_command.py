"""`sainet import` as a command, and physics evaluated on imported pushes."""

import json
from pathlib import Path

import numpy as np
import pytest

from datasets.own_pushes import HEADER, PROPERTIES, rows, to_csv, write
from datasets.raw_pushes import name, pack, recording, to_json
from sainet.cli.entry import run
from sainet.datasets import batch
from sainet.datasets.store import open_store
from sainet.runs.errors import BadStore


@pytest.fixture
def sources(tmp_path: Path) -> dict[str, list[str]]:
    """The arguments of each format."""
    zipped = pack(tmp_path / "in" / "ellip1_json.zip", {name(): to_json(recording())})
    table, bodies = write(tmp_path / "in", to_csv(rows()))
    return {
        "mitpush": [str(zipped)],
        "table": [str(table), "--properties", str(bodies)],
    }


@pytest.mark.parametrize("form", ["mitpush", "table"])
def test_physics_is_evaluated_on_imported_pushes(
    sources, tmp_path: Path, capfd: pytest.CaptureFixture[str], form: str
):
    out = str(tmp_path / "out")
    assert run(["import", form, *sources[form], "--out", out, "--json"]) == 0
    assert json.loads(capfd.readouterr().out.splitlines()[-1])["pushes"] == 1
    models = ["physics", "physics-true"]
    words = ["evaluate", "--model", *models, "--data", out, "--json", "--quiet"]
    assert run([*words, "--devices", "2"]) == 0
    found = json.loads(capfd.readouterr().out.splitlines()[-1])["rows"]
    assert {row["model"] for row in found} == set(models)
    assert all(row["n"] == 1 and 0 < row["pos_mm"] < 100 for row in found)


def test_a_group_is_evaluated_alone(tmp_path: Path, capfd: pytest.CaptureFixture[str]):
    named = [(f"{group}{k}", group) for k, group in enumerate(("wood", "felt", "wood"))]
    table = [[*row, group] for name, group in named for row in rows(name)]
    path, bodies = write(tmp_path / "in", to_csv(table, [*HEADER, "group"]))
    words = ["import", "table", str(path), "--properties", str(bodies)]
    data = str(tmp_path / "out")
    assert run([*words, "--out", data, "--json"]) == 0
    assert json.loads(capfd.readouterr().out)["groups"] == ["felt", "wood"]
    words = ["evaluate", "--model", "physics", "--data", data, "--devices", "2"]
    assert run([*words, "--group", "wood", "--json", "--quiet"]) == 0
    found = json.loads(capfd.readouterr().out.splitlines()[-1])["rows"]
    assert {(row["group"], row["n"]) for row in found} == {("wood", 2)}
    assert run([*words, "--group", "glass"]) == 2
    assert "no group 'glass'" in capfd.readouterr().err


def test_an_impossible_folder_gives_one_line(
    sources, tmp_path: Path, capfd: pytest.CaptureFixture[str]
):
    out = tmp_path / ("x" * 300)
    assert run(["import", "mitpush", *sources["mitpush"], "--out", str(out)]) == 2
    error = capfd.readouterr().err
    assert error.startswith(f"sainet: {tmp_path}/x")
    assert "cannot be read (File name too long)" in error
    assert len(error.splitlines()) == 1


@pytest.mark.parametrize(
    ("words", "wanted"),
    [
        (["table", "TABLE"], "--properties is missing"),
        (["mitpush", "ZIP", "--properties", "BODIES"], "--properties is for the"),
        (["mitpush", "TABLE"], "neither a .zip nor a folder"),
        (
            ["table", "ZIP", "--properties", "BODIES"],
            "unsupported file type; use .csv or .parquet",
        ),
        (["table", "TABLE", "--properties", "TABLE"], "not TOML"),
        (["mitpush", "x" * 300], "cannot be read"),
        (["mitpush-endpoints", "x" * 300], "cannot be read"),
        (["table", "x" * 300 + ".csv", "--properties", "BODIES"], "cannot be read"),
    ],
)
def test_bad_usage_is_one_line_and_status_2(
    sources, tmp_path: Path, capfd: pytest.CaptureFixture[str], words, wanted
):
    (zipped,), (table, _, bodies) = sources["mitpush"], sources["table"]
    known = {"ZIP": zipped, "TABLE": table, "BODIES": bodies}
    words = [known.get(word, word) for word in words]
    assert run(["import", *words, "--out", str(tmp_path / "out")]) == 2
    error = capfd.readouterr().err
    assert error.startswith("sainet: ")
    assert wanted in error
    assert len(error.splitlines()) == 1
    assert [path.name for path in tmp_path.iterdir()] == ["in"]


def test_a_push_that_an_engine_cannot_follow_is_named(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], monkeypatch
):
    real = batch.from_trajectory

    def broken(trajectory):
        motion, pusher = real(trajectory)
        return np.full_like(motion, np.nan), pusher

    monkeypatch.setattr(batch, "from_trajectory", broken)
    table, bodies = write(tmp_path / "in", to_csv(rows("a-7")))
    words = ["import", "table", str(table), "--properties", str(bodies)]
    out = tmp_path / "out"
    assert run([*words, "--out", str(out)]) == 1
    error = capfd.readouterr().err
    assert error.startswith(f"sainet: {table}: push 'a-7': engine planar")
    assert len(error.splitlines()) == 1
    with pytest.raises(BadStore):
        open_store(out)
    monkeypatch.undo()
    assert run([*words, "--out", str(out), "--quiet"]) == 0


def test_options_override_the_properties_file(sources, tmp_path: Path):
    out = tmp_path / "out"
    words = ["import", "table", *sources["table"], "--out", str(out)]
    assert run([*words, "--contact-friction", "0.35", "--quiet"]) == 0
    config = json.loads((out / "config.json").read_text())
    assert config["contact_friction"] == 0.35
    assert "contact = 0.2" in PROPERTIES


def test_the_example_of_the_documentation_is_imported(tmp_path: Path):
    """Its five rows, with the one that is missing for a whole push."""
    text = (Path(__file__).parents[2] / "docs" / "importing.md").read_text()
    blocks = [
        line.removeprefix("    ") for line in text.splitlines() if line[:4] == "    "
    ]
    start = blocks.index("push,time,body,x,y,angle,pusher_x,pusher_y")
    table = blocks[start : start + 6] + ["1,0.008,blue,0.4050,0,0,0.2454,0.0010"]
    rest = blocks[blocks.index("[bodies.red]") :]
    properties = "\n".join(line for line in rest if not line.startswith("sainet"))
    path, bodies = write(tmp_path / "in", "\n".join([*table, ""]), properties)
    words = ["import", "table", str(path), "--properties", str(bodies)]
    assert run([*words, "--out", str(tmp_path / "out"), "--quiet"]) == 0
