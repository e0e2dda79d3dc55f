"""The benchmark scores as NumPy does, refuses what is not its own, and ranks."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from msgspec import structs

import sainet as sn
from sainet.api import benchmark
from sainet.cli.entry import parse
from sainet.datasets.recorded.endpoints import import_endpoints
from sainet.datasets.splits import make_folds
from sainet.evaluation.measurements import read_measurements
from sainet.runs.errors import BadInput
from sainet.studies.evidence import Evidence
from sainet.studies.paper_setup import PaperSetup
from sainet.studies.recorded_pushes import FOLDS
from support import REPOSITORY, require

TINY = "tiny"
SIMULATED = {
    "table-1": ("direct-force", 2),
    "table-2": ("direct-force", 3),
    "table-3": ("robot", 2),
}


def travels(pushes) -> np.ndarray:
    """How far each disk of each push travels (mm), from its start to its last pose."""
    batch = pushes.batch()
    travel = np.asarray(batch.truth)[:, -1, :, :2] - np.asarray(batch.initial.position)
    return 1000 * np.linalg.norm(travel, axis=-1)


@pytest.fixture
def tiny(pushes, monkeypatch) -> benchmark.Track:
    """A track of the twelve short pushes."""
    made = benchmark.Track(
        title="Twelve pushes",
        study="robot-two-disks",
        command="sainet generate",
        hash=benchmark.hash_of(pushes),
        travel_mm=tuple(travels(pushes).mean(axis=0).tolist()),
    )
    known = benchmark.tracks() | {TINY: made}
    monkeypatch.setattr(benchmark, "tracks", lambda: known)
    return made


@pytest.fixture
def pose(pushes) -> np.ndarray:
    """The true poses, off by noise, [push, time, body, 3] (m, m, rad)."""
    truth = np.asarray(pushes.batch().truth)[..., :3]
    return truth + np.random.default_rng(0).normal(0, 0.003, truth.shape)


@pytest.fixture
def file(pose, pushes, tmp_path) -> Path:
    np.savez(tmp_path / "mine.npz", hash=pushes.hashes, pose=pose)
    return tmp_path / "mine.npz"


def test_a_score_is_that_of_a_plain_loop(tiny, pose, file, pushes, tmp_path):
    table = sn.score(
        file, TINY, pushes, name="Mine", entry=tmp_path / "e.json", authors="A. Author"
    )
    truth = np.asarray(pushes.batch().truth, np.float64)[..., :3]
    entry = benchmark.read_entry(tmp_path / "e.json")
    rows = [row for row in table.rows if row["model"] == "Mine"]
    assert [row["model"] for row in table.rows][:1] == ["physics"]
    assert (entry.name, entry.authors, entry.track) == ("Mine", "A. Author", TINY)
    assert [row.body for row in entry.errors] == [1, 2]
    for body, (row, kept) in enumerate(zip(rows, entry.errors, strict=True)):
        position, rotation = [], []
        for push in range(len(pushes)):
            for step in range(truth.shape[1]):
                off = pose[push, step, body] - truth[push, step, body]
                position.append(1000 * (off[0] ** 2 + off[1] ** 2) ** 0.5)
                rotation.append(abs(np.degrees(off[2])))
        assert row["pos_mm"] == pytest.approx(np.mean(position), rel=1e-5)
        assert row["rot_deg"] == pytest.approx(np.mean(rotation), rel=1e-5)
        assert kept.values.keys() == {"pos_mm", "rot_deg"}
        found = kept.values["pos_mm"]
        assert found.value == row["pos_mm"]
        assert found.low < found.value < found.high


def test_folds_are_those_of_the_study(tiny, file, pushes, monkeypatch):
    made = structs.replace(tiny, folds=3)
    known = benchmark.tracks() | {TINY: made}
    monkeypatch.setattr(benchmark, "tracks", lambda: known)
    measured = sn.score(file, TINY, pushes).measured
    for fold in make_folds(pushes.store, 3):
        is_in = measured.data["fold"].values == fold.number
        assert np.array_equal(np.flatnonzero(is_in), fold.rows)
    assert sn.track("recorded").folds == FOLDS["paper"]


def test_other_tracks_data_and_predictions_are_refused(
    tiny, pose, file, pushes, tmp_path
):
    with pytest.raises(BadInput, match="did you mean table-1"):
        sn.score(file, "tabel-1", pushes)
    with pytest.raises(BadInput, match=r"recorded: hash is .* run 'sainet generate'"):
        sn.score(file, TINY, pushes.first(11))
    np.savez(file, hash=pushes.hashes[:9], pose=pose[:9])
    with pytest.raises(BadInput, match=r"mine\.npz: no prediction of 3 of the 12"):
        sn.score(file, TINY, pushes)
    np.savez(file, hash=pushes.hashes, pose=pose[:, -1])
    with pytest.raises(BadInput, match=r"mine\.npz: pos_mm .* predict all steps"):
        sn.score(file, TINY, pushes)
    pose[3, 2, 1, 0] = np.nan
    np.savez(file, hash=pushes.hashes, pose=pose)
    with pytest.raises(BadInput, match=r"mine\.npz: pose, x is nan"):
        sn.score(file, TINY, pushes)


@pytest.mark.parametrize("bad", ["a|b", "<script>", "[x](y)", "two\nlines"])
def test_a_name_that_would_break_a_page_is_refused(tiny, file, pushes, tmp_path, bad):
    path = tmp_path / "e.json"
    with pytest.raises(BadInput, match=r"e\.json: name: "):
        sn.score(file, TINY, pushes, name=bad, entry=path)
    assert not path.exists()


EDITS = {
    "digest": lambda entry: entry | {"authors": "Others"},
    "track": lambda entry: entry | {"track": "other"},
    "hash": lambda entry: entry | {"hash": 3},
    "link": lambda entry: entry | {"link": "javascript:x"},
    "errors": lambda entry: entry | {"errors": "none"},
    "format_version": lambda entry: entry | {"format_version": 2},
}


@pytest.mark.parametrize("field", EDITS)
def test_an_edited_entry_is_refused(tiny, file, pushes, tmp_path, field):
    path = tmp_path / "e.json"
    sn.score(file, TINY, pushes, entry=path)
    path.write_text(json.dumps(EDITS[field](json.loads(path.read_text()))))
    with pytest.raises(BadInput, match=rf"e\.json: .*{field}") as error:
        benchmark.read_entry(path)
    assert "\n" not in str(error.value)


def test_an_entry_of_other_data_is_refused(tiny, file, pushes, tmp_path):
    path = tmp_path / "e.json"
    sn.score(file, TINY, pushes, entry=path)
    entry = structs.replace(benchmark.read_entry(path), hash="0" * 64).digested()
    benchmark.documents.write_document(path, entry)
    with pytest.raises(BadInput, match=r"e\.json: hash is 000000000.*, not "):
        benchmark.read_entry(path)


@pytest.mark.parametrize("name", SIMULATED)
def test_the_command_of_a_track_makes_the_test_pushes_of_its_study(name):
    setup, disks = SIMULATED[name]
    wanted = PaperSetup(setup, "paper").test_pushes().config
    found = parse(sn.track(name).command.split()[1:]).config
    assert vars(found) == vars(replace(wanted, disks=disks))


@pytest.mark.recorded
def test_the_hash_of_recorded_pushes_is_that_of_the_import(
    recorded_pushes_folder, tmp_path
):
    store = import_endpoints(recorded_pushes_folder / "ellip1_endpoints.csv", tmp_path)
    assert benchmark.hash_of(store) == sn.track("recorded").hash
    measured = sn.evaluate(["physics"], store).measured
    sn.track("recorded").check_travel(measured, store.path)
    assert set(sn.track("recorded").fold_of_push(store)) == set(range(5))


@pytest.mark.slow
def test_the_hash_of_simulated_pushes_is_that_of_the_stored_measurements(tmp_path):
    pytest.importorskip("pybullet")
    config = PaperSetup("robot", "paper").test_pushes().config
    pushes = sn.generate(config, tmp_path / "pushes", progress=False)
    assert benchmark.hash_of(pushes) == sn.track("table-3").hash
    stored = REPOSITORY / "results" / "robot-two-disks.nc.xz"
    require(stored.is_file(), "the measurements are not in this copy")
    # Processors differ in last bits, which the contacts of a few pushes amplify.
    known = read_measurements(stored).data["travel_mm"].values
    off = np.abs(travels(pushes) - known)
    assert off.max() < 0.3
    assert np.quantile(off, 0.8) < 1e-3


@pytest.mark.parametrize("name", SIMULATED)
def test_the_disks_of_a_track_travel_as_far_as_in_its_study(name):
    chosen = sn.track(name)
    stored = REPOSITORY / "results" / f"{chosen.study}.nc.xz"
    require(stored.is_file(), "the measurements are not in this copy")
    chosen.check_travel(read_measurements(stored), stored)


def test_pushes_of_another_engine_are_refused(tiny, small, tmp_path):
    """Their starts and commands, hence their hash, are the same."""
    pytest.importorskip("pybullet")
    config = replace(small, engine="bullet")
    other = sn.generate(config, tmp_path / "other", progress=False)
    assert benchmark.hash_of(other) == tiny.hash
    pose = np.asarray(other.batch().truth)[..., :3]
    np.savez(tmp_path / "mine.npz", hash=other.hashes, pose=pose)
    with pytest.raises(
        BadInput, match=r"other: the disks travel .* mm on average, not \("
    ):
        sn.score(tmp_path / "mine.npz", TINY, other)


@pytest.fixture
def page(monkeypatch):
    """The generator of the page."""
    require((REPOSITORY / "results").is_dir(), "this copy has no results")
    monkeypatch.syspath_prepend(REPOSITORY / "docs")
    import site_pages.benchmark

    return site_pages.benchmark


def test_models_are_ranked_by_their_mean_errors(page):
    assert page.ranks([0.3, 0.1, 0.3, 0.2]) == [3, 1, 3, 2]
    for track in benchmark.tracks().values():
        summary = Evidence(REPOSITORY).summary(track.study)
        text = page.ranking(page.standings(summary, track.condition, "study"), track)
        lines = [line.split(" | ") for line in text.splitlines()[2:]]
        slugs = {model.label: model.slug for model in summary.models}
        means = []
        for line in lines:
            values = [
                row.values[track.position].value
                for row in (*summary.rows, *summary.predictions)
                if row.model == slugs[line[2]] and row.condition == track.condition
            ]
            means.append(np.mean(values))
            assert f"{values[0]:.2f}" in line[4]
        assert means == sorted(means)
        assert len(lines) > 5


def test_every_entry_in_results_is_valid_and_on_the_page(page):
    text = page.rankings(REPOSITORY)
    paths = list((REPOSITORY / "results" / "entries").glob("*.json"))
    for entry in map(benchmark.read_entry, paths):
        assert entry.track in benchmark.tracks()
        assert f"| {entry.name} |" in text
    for name, track in benchmark.tracks().items():
        assert f"## Track `{name}`" in text and track.command in text
