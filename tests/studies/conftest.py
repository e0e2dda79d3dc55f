"""A runner in one process, for tiny studies."""

from concurrent.futures import ThreadPoolExecutor

import pytest

from sainet.evaluation.measurements import read_measurements
from sainet.runs.documents import read_document
from sainet.studies import load_study
from sainet.studies.paper_setup import IN, SAIN, Sizes
from sainet.studies.runner import Runner
from sainet.studies.study import STEPS, TABLE, Result, Scope


@pytest.fixture
def tiny(monkeypatch):
    """Every study as small as it can be."""
    sizes = {"quick": Sizes(pushes=6, tests=4, iterations=1)}
    places: dict[str, object] = {"paper_setup.SIZES": sizes}
    places["paper_setup._QUICK_BATCH"] = 2  # of one size, to share compiled code
    places["pretrained.SIZES"] = {"quick": (4, 4, 1)}
    places["data_efficiency.PUSHES"] = {"quick": (3, 6)}
    places["data_efficiency.AGAIN"] = {"quick": 6}
    places["variants.L2"] = (1e-4, 1e-6)
    # The tables have every network; here one is enough, and compiles faster.
    for name in ("data_efficiency", "variants", "robustness"):
        places[f"{name}.NETWORKS"] = (IN,)
    places["paper_tables.BESIDE"] = (SAIN,)
    for name, value in places.items():
        monkeypatch.setattr(f"sainet.studies.{name}", value)


@pytest.fixture
def runner(tmp_path):
    with ThreadPoolExecutor(1) as executor:
        yield Runner(tmp_path / STEPS, executor)


@pytest.fixture
def make(tiny, runner, tmp_path):
    """Runs a study by name; all of a test share the run folders of steps."""

    def run(name, recorded=None):
        out = tmp_path / name
        found = load_study(name).run(name, Scope("quick", recorded), runner, out)
        assert read_document(out / TABLE, Result) == found
        measured = read_measurements(out / "measurements.nc")
        assert measured.header.conditions == found.summary.conditions
        return found.to_json()

    return run
