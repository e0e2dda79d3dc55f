"""The paper's tables, tiny: their rows, what they share, and what they are beside."""

from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from importlib.util import find_spec

import pytest

from sainet.experiments import load_experiment
from sainet.experiments.chain import Chain
from sainet.experiments.paper_tables import AROUND
from sainet.experiments.published import DIRECT_FORCE_THREE_DISKS, published_rows
from sainet.runs import read_json
from support import require


@contextmanager
def no_bar(title, total):
    yield lambda done, note: None


def make(name, out):
    with ThreadPoolExecutor(1) as executor:
        chain = Chain(out / name, executor, print, no_bar)
        return load_experiment(name)("quick", chain)


@pytest.mark.slow
def test_tables_of_one_setup_share_data_and_networks(tmp_path, monkeypatch):
    require(find_spec("pybullet"), "PyBullet is not installed")
    tiny = {"quick": (6, 4, 2)}
    monkeypatch.setattr("sainet.experiments.paper_tables._SIZES", tiny)
    two = make("direct-force-two-disks", tmp_path)
    cards = {path: path.stat().st_mtime_ns for path in tmp_path.rglob("card.json")}
    three = make("direct-force-three-disks", tmp_path)
    assert len(cards) == 1 + len(AROUND)
    assert {path: path.stat().st_mtime_ns for path in cards} == cards
    models = {"physics", "physics-calibrated", "in", *AROUND}
    for disks, table in ((2, two), (3, three)):
        rows = {(row["model"], row["body"]) for row in table["rows"]}
        assert rows == {(m, b) for m in models for b in range(1, disks + 1)}
        assert all(row["n"] == 4 for row in table["rows"])
    assert three["published"] == published_rows(DIRECT_FORCE_THREE_DISKS)
    kept = read_json(tmp_path / "direct-force-three-disks" / "table.json")
    assert kept["rows"] == three["rows"]
    engines = {
        read_json(path)["model"] + " " + str(read_json(path)["inner_engine"])
        for path in cards
    }
    assert engines == {"in None", *(f"sain {engine}" for engine in AROUND.values())}
