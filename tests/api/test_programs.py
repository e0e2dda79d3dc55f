"""The short programs of the documentation run as they are shown."""

import os
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

from api.programs import CONTROL, OWN_DATA, PREDICT
from sainet.learning import recipes
from support import SOURCE, require


def run(program: str) -> dict[str, object]:
    names: dict[str, object] = {}
    exec(compile(program, str(SOURCE), "exec"), names)
    return names


def test_predict():
    found = run(PREDICT)["trajectory"].final.position
    assert found.shape == (2, 2)
    assert 0.009 < found[0, 0] < 0.012  # m: the pusher moved by 10 mm
    assert found[0, 1] > 0.001  # pushed from the right, the disk moves to the left


@pytest.fixture
def few_iterations(monkeypatch):
    """Trainings that start as an engine take 20 iterations, not 1,200."""
    short = recipes.RESIDUAL.changed(iterations=20)
    monkeypatch.setitem(recipes.RECIPES, recipes.FromSimulator, short)


@pytest.mark.slow
def test_own_data(folder, monkeypatch, few_iterations, capsys):
    monkeypatch.chdir(folder)
    names = run(OWN_DATA)
    assert "sain errs by" in capsys.readouterr().out
    assert names["table"].to_pandas()["model"].unique().tolist() == [
        *("physics", "physics-true", "fitted", "sain")
    ]
    assert "sain errs by" in (folder / "report.html").read_text()
    # Nothing else was left behind.
    assert {path.name for path in folder.iterdir()} == {"runs", "report.html"}
    assert [path.name for path in (folder / "runs").iterdir()] == ["recorded"]


def test_control():
    require(find_spec("gymnasium"), "gymnasium is not installed")
    names = run(CONTROL)
    assert names["terminated"] and names["info"]["is_success"]


def test_compiled_programs_are_kept_for_the_next_script(tmp_path):
    names = ("JAX_COMPILATION_CACHE_DIR", "JAX_ENABLE_COMPILATION_CACHE")
    environment = {k: v for k, v in os.environ.items() if k not in names}
    environment |= {"XDG_CACHE_HOME": str(tmp_path)}
    code = f"{PREDICT}\nimport jax; print(jax.config.jax_compilation_cache_dir)"
    command = [sys.executable, "-W", "error", "-c", code]
    done = subprocess.run(
        command, env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""  # no progress, no warning
    folder = Path(done.stdout.splitlines()[-1])
    assert folder.parent == tmp_path / "sainet"
