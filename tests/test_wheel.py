"""What people download: the wheel works where nothing else is, and so does its page."""

import os
import re
import shutil
import subprocess
import sys
import sysconfig
import tarfile
from email import message_from_bytes
from importlib import metadata
from pathlib import Path
from zipfile import ZipFile

import pytest
from packaging.metadata import Metadata

from api.programs import CONTROL, OWN_DATA, PREDICT
from documents import README, mentions
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


# Programs of README.md, the training made short as in tests/api/test_programs.py; this
# Python runs it as shown.
OWN = f"""
from sainet.learning import recipes
short = recipes.RESIDUAL.changed(iterations=20)
recipes.RECIPES[recipes.FromSimulator] = short
{OWN_DATA}
"""
PLANNED = f"""
{CONTROL}
print(terminated, info["is_success"])
"""
PYTHONS = ("3.11", "3.12", "3.13")
RUNNING = "{}.{}".format(*sys.version_info[:2])


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


def find_python(version: str) -> Path:
    """An interpreter, in PATH or in pyenv's folder, that truly runs; else a skip."""
    if version == RUNNING:
        return Path(sys.executable)
    shelves = (Path.home() / ".pyenv" / "versions").glob(f"{version}.*/bin/python")
    named = shutil.which(f"python{version}")
    for python in [*([Path(named)] if named else []), *sorted(shelves)]:
        code = "import ensurepip, sys; print('%d.%d' % sys.version_info[:2])"
        if run(python, "-c", code).stdout.strip() == version:
            return python
    pytest.skip(f"this machine has no Python {version}")


@pytest.fixture(scope="module")
def archives(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The source archive, and the wheel that is built from it alone."""
    folder = tmp_path_factory.mktemp("dist")
    build = ("-m", "build", "--no-isolation", "--outdir", folder)
    run_well(sys.executable, *build, REPOSITORY)
    return folder


@pytest.fixture(scope="module")
def wheel(archives: Path) -> Path:
    return next(archives.glob("*.whl"))


def pins(lock: str = "requirements.lock") -> list[str]:
    """Versions of a lock without hashes: a new upstream release cannot fail us."""
    text = (REPOSITORY / lock).read_text()
    return re.findall(r"^[\w.-]+==[^\s\\;]+", text, re.MULTILINE)


def install(python: Path, wheel: Path, folder: Path) -> Path:
    """A fresh environment with the wheel and its base dependencies, no extras."""
    venv = folder / "venv"
    run_well(python, "-m", "venv", "--without-pip", venv)
    if python == Path(sys.executable):  # the same packages are here: unpacked already
        link(venv, *(pin.partition("==")[0] for pin in pins()))
        run_well(*pip(venv), "--no-index", wheel)
        return venv
    fetch(venv, wheel)
    return venv


def add_gymnasium(python: Path, venv: Path) -> None:
    """Follow the advice of `MissingExtra`, of which pip needs no sainet on an index."""
    if python == Path(sys.executable):
        link(venv, "gymnasium", "farama-notifications", "cloudpickle")
        run_well(*pip(venv), "--no-index", "sainet[gym]")
    else:
        fetch(venv, "sainet[gym]")


def pip(venv: Path) -> tuple[object, ...]:
    """This environment's own pip, to install into another one.

    Without bytecode: compiling half a gigabyte takes longer than unpacking it.
    """
    quick = ("install", "--no-compile", "--quiet", "--disable-pip-version-check")
    return (sys.executable, "-m", "pip", "--python", venv / "bin" / "python", *quick)


def fetch(venv: Path, wanted: object) -> None:
    """Installs locked versions from an index; without one, the test is skipped."""
    constraints = venv / "pins.txt"
    constraints.write_text("\n".join(pins("requirements-dev.lock")))
    done = run(*pip(venv), "-c", constraints, wanted)
    offline = any(sign in done.stdout + done.stderr for sign in OFFLINE)
    require(done.returncode == 0 or not offline, "no package index can be reached")
    assert done.returncode == 0, done.stdout + done.stderr


def link(venv: Path, *names: str) -> None:
    """Links distributions of this environment, and nothing else."""
    here = Path(sysconfig.get_path("purelib"))
    packages = next(venv.glob("lib/*/site-packages"))
    for distribution in names:
        for file in metadata.files(distribution) or []:
            name = file.parts[0]
            if name != ".." and not (packages / name).exists():
                (packages / name).symlink_to(here / name)


def shipped(package: Path) -> set[str]:
    """Every file of an installed or checked-out package but bytecode."""
    files = (path for path in package.rglob("*") if path.is_file())
    names = (path.relative_to(package) for path in files)
    return {name.as_posix() for name in names if "__pycache__" not in name.parts}


@pytest.fixture(scope="module")
def contents(archives: Path) -> dict[str, bytes]:
    """Files of the source archive, by their paths in the repository."""
    with tarfile.open(next(archives.glob("*.tar.gz"))) as archive:
        return {
            member.name.partition("/")[2]: archive.extractfile(member).read()
            for member in archive.getmembers()
            if member.isfile()
        }


def targets(markdown: str) -> list[tuple[str, str]]:
    """Links of a page, "!" before pictures."""
    return re.findall(r"(!?)\[[^\]]*\]\(([^)#]+)[^)]*\)", markdown)


def test_the_source_archive_is_complete(contents: dict[str, bytes]):
    """It has the package, the tests and all that README.md links to."""
    package = {f"src/sainet/{name}" for name in shipped(SOURCE)}
    tests = {f"tests/{name}" for name in shipped(REPOSITORY / "tests")}
    assert package | tests <= contents.keys()
    folders = {str(parent) for name in contents for parent in Path(name).parents}
    linked = {link for _, link in targets(README.read_text()) if "://" not in link}
    assert len(linked) > 20
    assert linked <= contents.keys() | folders


def test_links_and_pictures_work_on_the_page_of_an_index(
    wheel: Path, contents: dict[str, bytes]
):
    (name,) = (each for each in ZipFile(wheel).namelist() if each.endswith("/METADATA"))
    Metadata.from_email(ZipFile(wheel).read(name), validate=True)  # as an index does
    about = message_from_bytes(ZipFile(wheel).read(name))
    assert about["Description-Content-Type"] == "text/markdown"
    page = about.get_payload()
    assert message_from_bytes(contents["PKG-INFO"]).get_payload() == page
    (address,) = (each.split(", ")[1] for each in about.get_all("Project-URL"))
    wanted = []
    for picture, link in targets(README.read_text()):
        tag = f"{address}/{'raw' if picture else 'blob'}/v{about['Version']}"
        wanted.append((picture, link if "://" in link else f"{tag}/{link}"))
    assert targets(page) == wanted
    assert sum(picture == "!" for picture, _ in wanted) == 2


def test_one_command_replaces_the_address_everywhere(contents: dict[str, bytes]):
    placeholder = "-".join(("URL", "OF", "THIS", "REPOSITORY"))  # not here, too
    found = {name for name, data in contents.items() if placeholder.encode() in data}
    text = contents["docs/releasing.md"].decode()
    (named,) = re.findall(rf"sed -i 's.{placeholder}.[^']*' (.*)", text)
    places = found - {"PKG-INFO", "docs/releasing.md"}
    assert places in (set(), set(named.split()))  # none once it is replaced


@pytest.mark.parametrize("version", PYTHONS)
def test_the_wheel_runs_the_readme_in_an_empty_environment(
    version: str, wheel: Path, tmp_path: Path
):
    python = find_python(version)
    venv = install(python, wheel, tmp_path)
    command, empty = venv / "bin" / "sainet", tmp_path / "empty"
    empty.mkdir()

    def shown_by(program: str) -> str:
        path = empty / "program.py"
        path.write_text(program)
        return run_well(venv / "bin" / "python", path, cwd=empty)

    assert wheel.name.split("-")[1] in run_well(command, "--version", cwd=empty)
    assert "demo" in run_well(command, "--help", cwd=empty)
    package = Path(shown_by(IMPORT_ALL).strip()).parent
    assert package.is_relative_to(venv)
    assert package.parent.name == "site-packages"
    assert "py.typed" in shipped(package)
    assert shipped(package) == shipped(SOURCE)

    assert shown_by(PREDICT).startswith("[[0.01")  # m: disk 1 moved with the pusher
    (made,) = (line for line in mentions(README.read_text()) if " generate " in line)
    run_well(command, *made.split()[1:], cwd=empty)
    assert "sain errs by" in shown_by(OWN_DATA if version == RUNNING else OWN)
    assert "sain errs by" in (empty / "report.html").read_text()
    add_gymnasium(python, venv)
    assert shown_by(PLANNED).split() == ["True", "True"]
