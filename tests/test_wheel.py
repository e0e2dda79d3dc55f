"""The wheel, installed where nothing else is: does what people download work?"""

import os
import re
import shutil
import subprocess
import sys
import sysconfig
from collections.abc import Iterator
from importlib import metadata
from pathlib import Path

import pytest

from api.programs import PREDICT
from support import REPOSITORY, SOURCE, require

pytestmark = pytest.mark.slow

OFFLINE = ("NewConnectionError", "NameResolutionError", "Failed to establish")
IMPORT_ALL = """
import importlib, pkgutil, sainet
from sainet.runs.errors import MissingExtra
for module in pkgutil.walk_packages(sainet.__path__, "sainet."):
    try:
        if not module.name.endswith("__main__"):
            importlib.import_module(module.name)
    except MissingExtra:  # classes of Gymnasium cannot be defined without it
        assert module.name.startswith("sainet.control.gym."), module.name
print(sainet.__file__)
"""


SHOWN = f"{PREDICT}\nprint(trajectory.final.position)"


def run(*command: object, **settings: object) -> subprocess.CompletedProcess[str]:
    """Runs a command away from the repository and without its settings for Python."""
    words = [str(word) for word in command]
    environment = {k: v for k, v in os.environ.items() if not k.startswith("PYTHON")}
    return subprocess.run(
        words, capture_output=True, text=True, check=False, env=environment, **settings
    )


def run_well(*command: object, **settings: object) -> str:
    """Output of a command; any exit status except 0 fails the test."""
    done = run(*command, **settings)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def other_pythons() -> Iterator[Path]:
    """Interpreters of newer versions, in PATH and in pyenv's folder, that truly run."""
    for version in ("3.12", "3.13"):
        shelves = (Path.home() / ".pyenv" / "versions").glob(f"{version}.*/bin/python")
        named = shutil.which(f"python{version}")
        for python in [*([Path(named)] if named else []), *sorted(shelves)]:
            code = "import ensurepip, sys; print('%d.%d' % sys.version_info[:2])"
            if run(python, "-c", code).stdout.strip() == version:
                yield python


def another_python() -> Path:
    """A Python of another version than this one; no failure where there is none."""
    running = "{}.{}".format(*sys.version_info[:2])
    for python in other_pythons():
        if running not in run(python, "--version").stdout:
            return python
    pytest.skip("this machine has no other Python among 3.12 and 3.13")


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The wheel, built with the environment's own hatchling."""
    folder = tmp_path_factory.mktemp("wheel")
    build = ("-m", "build", "--wheel", "--no-isolation", "--outdir", folder)
    run_well(sys.executable, *build, REPOSITORY)
    return next(folder.glob("*.whl"))


def pins() -> list[str]:
    """Versions of the lock without hashes: a new upstream release cannot fail us."""
    lock = (REPOSITORY / "requirements.lock").read_text()
    return re.findall(r"^[\w.-]+==[^\s\\]+", lock, re.MULTILINE)


def install(python: Path, wheel: Path, folder: Path) -> Path:
    """A fresh environment with the wheel and its base dependencies, no extras."""
    # This environment's own pip fills it; and no bytecode: compiling half a gigabyte
    # takes longer than unpacking it.
    venv, constraints = folder / "venv", folder / "pins.txt"
    run_well(python, "-m", "venv", "--without-pip", venv)
    pip = (sys.executable, "-m", "pip", "--python", venv / "bin" / "python", "install")
    quick = ("--no-compile", "--quiet", "--disable-pip-version-check")
    if python == Path(sys.executable):  # the same packages are here: unpacked already
        link_base(next(venv.glob("lib/*/site-packages")))
        run_well(*pip, *quick, "--no-index", wheel)
        return venv
    constraints.write_text("\n".join(pins()))
    done = run(*pip, *quick, "-c", constraints, wheel)
    offline = any(sign in done.stdout + done.stderr for sign in OFFLINE)
    require(done.returncode == 0 or not offline, "no package index can be reached")
    assert done.returncode == 0, done.stdout + done.stderr
    return venv


def link_base(packages: Path) -> None:
    """Links what the lock of the base installation names, and nothing else."""
    here = Path(sysconfig.get_path("purelib"))
    for pin in pins():
        for file in metadata.files(pin.partition("==")[0]) or []:
            name = file.parts[0]
            if name != ".." and not (packages / name).exists():
                (packages / name).symlink_to(here / name)


def shipped(package: Path) -> set[str]:
    """Every file of an installed or checked-out package but bytecode."""
    files = (path for path in package.rglob("*") if path.is_file())
    names = (path.relative_to(package) for path in files)
    return {name.as_posix() for name in names if "__pycache__" not in name.parts}


@pytest.mark.parametrize("version", ["this", "another"])
def test_the_wheel_works_in_an_empty_environment(
    version: str, wheel: Path, tmp_path: Path
):
    python = Path(sys.executable) if version == "this" else another_python()
    venv = install(python, wheel, tmp_path)
    command = venv / "bin" / "sainet"
    project_version = wheel.name.split("-")[1]

    assert project_version in run_well(command, "--version", cwd=tmp_path)
    assert "demo" in run_well(command, "--help", cwd=tmp_path)
    origin = run_well(venv / "bin" / "python", "-c", IMPORT_ALL, cwd=tmp_path).strip()
    shown = run_well(venv / "bin" / "python", "-c", SHOWN, cwd=tmp_path)
    assert shown.startswith("[[0.01"), shown  # m: disk 1 moved with the pusher
    package = Path(origin).parent
    assert package.is_relative_to(venv)
    assert package.parent.name == "site-packages"
    assert "py.typed" in shipped(package)
    assert shipped(package) == shipped(SOURCE)
