"""A chain without bars, in one process, for tiny experiments."""

from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import replace

import pytest

from sainet.evaluation.measurements import read_measurements
from sainet.runs.documents import read_document
from sainet.studies import load_experiment
from sainet.studies.chain import Chain
from sainet.studies.paper_setup import Sizes
from sainet.studies.result import TABLE, Result


@contextmanager
def no_bar(title, total):
    yield lambda done, note: None


@pytest.fixture
def tiny(monkeypatch):
    """Every experiment as small as it can be."""
    sizes = {"quick": Sizes(pushes=6, tests=4, iterations=1)}
    monkeypatch.setattr("sainet.studies.paper_setup.SIZES", sizes)
    strokes = {"quick": (4, 1)}
    monkeypatch.setattr("sainet.studies.strokes.SIZES", strokes)
    places: dict[str, object] = {"data_efficiency.PUSHES": {"quick": (3, 6)}}
    places["data_efficiency.AGAIN"] = 6
    places["regularisation.CHOICES"] = (1e-4, 1e-6)
    # The tables have every network; here one is enough, and compiles faster.
    for name in ("data_efficiency", "recurrent_or_not", "regularisation", "robustness"):
        places[f"{name}.NETWORKS"] = ("in",)
    places["paper_tables.BESIDE"] = ("sain",)
    for name, value in places.items():
        monkeypatch.setattr(f"sainet.studies.{name}", value)


@pytest.fixture
def chain(tmp_path):
    with ThreadPoolExecutor(1) as executor:
        yield Chain(tmp_path / "experiment", executor, print, no_bar)


@pytest.fixture
def make(tiny, chain, tmp_path):
    """Runs an experiment by name; all of a test share one folder."""

    def run(name):
        own = replace(chain, out=tmp_path / name)
        found = load_experiment(name)("quick", own)
        assert read_document(own.out / TABLE, Result) == found
        measured = read_measurements(own.out / "measurements.nc")
        assert measured.header.conditions == found.summary.conditions
        return found.to_json()

    return run
