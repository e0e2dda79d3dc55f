"""Commands and make targets in README.md and docs/ exist."""

import ast
import json
import os
import re
import shlex
import subprocess
import sys
import tomllib
from dataclasses import is_dataclass
from functools import lru_cache
from pathlib import Path
from typing import get_args, get_type_hints

import pytest

from api.programs import CONTROL, OWN_DATA, PREDICT
from documents import (
    PAGES,
    README,
    commands,
    make_targets,
    mentions,
    shell_lines,
    site_contents,
)
from sainet import __version__
from sainet.cli import entry
from support import REPOSITORY, SOURCE

COMMANDS = {page.name: commands(page.read_text()) for page in PAGES}
# Reads a list of commands; answers with what each asks for and where that is written.
# In a process of its own: the types of settings that are left to give are not checked.
PARSER = """
import json, shlex, sys
from dataclasses import replace
from sainet.cli.entry import parse
asked = {}
for command in json.load(sys.stdin):
    try:
        found = parse(shlex.split(command)[1:])
    except SystemExit:
        asked[command] = None  # the reason was printed
        continue
    if hasattr(found, "machines"):  # any machines may share a folder
        found = replace(found, machines=type(found.machines)())
    asked[command] = [str(getattr(found, "out", None) or ""), repr(found)]
json.dump(asked, sys.stdout)
"""


@lru_cache
def parsed() -> dict[str, list[str] | None]:
    """What every documented command asks for; None if it does not parse."""
    every = [command for page in COMMANDS.values() for command in page]
    found = subprocess.run(
        [sys.executable, "-c", PARSER],
        input=json.dumps(every),
        capture_output=True,
        text=True,
        check=False,
    )
    assert found.returncode == 0, found.stdout + found.stderr
    print(found.stderr)  # should one fail
    return json.loads(found.stdout)


# Other commands that pages show, and where they run. A new kind needs a test.
ELSEWHERE = {
    "make": "test_every_documented_make_target_exists",
    "python -m build": "test_wheel.py",
    "python -m pip install build": "test_wheel.py",
    "../empty/bin/": "test_wheel.py",
    "python -m venv": "test_wheel.py",
    "python -m pip install -e": "tools/setup.sh, in CI",
    "pip install": "extras: below",
    "dask": "runs/dask_cluster.py",
    "sainet": "cli/test_documented.py",
}
NOT_RUN = {
    "git clone": "CI has a clone",
    ". .venv/bin/activate": "changes only the path of commands",
    "python3.11 -m venv": "the Python of CI",
    "python -m pip install -U jax[cuda12]": "needs a GPU",
    "python -c import jax; print(jax.devices())": "needs a GPU",
    "sbatch": "needs a cluster",
    "job=$(sbatch": "needs a cluster",
}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_documented_command_is_run_somewhere(page: Path):
    _, executed = site_contents()
    if page.stem in executed:  # with other commands of the shell
        return
    known = (*ELSEWHERE, *NOT_RUN)
    lines = (" ".join(shlex.split(line)) for line in shell_lines(page.read_text()))
    assert [line for line in lines if not line.startswith(known)] == []


EXTRAS = tomllib.loads((REPOSITORY / "pyproject.toml").read_text())["project"][
    "optional-dependencies"
]


def test_links_of_contributing_lead_to_pages_of_the_site(monkeypatch):
    monkeypatch.syspath_prepend(REPOSITORY / "docs")
    from site_pages.reference import project_file

    links = re.findall(r"\]\((?!http)([^)#]+)", project_file("CONTRIBUTING.md"))
    assert links
    assert [link for link in links if not (REPOSITORY / "docs" / link).exists()] == []


def test_documented_extras_exist():
    found = set()
    for page in PAGES:
        for names in re.findall(r"(?:sainet|\.)\[([a-z,]+)\]", page.read_text()):
            found |= set(names.split(","))
    assert {"bullet", "gym", "live", "mujoco"} <= found
    assert found <= set(EXTRAS)


def test_messages_about_missing_packages_name_extras_that_exist():
    asked = r"""missing_extra\(\s*(?:"[^"]*"|needs), "(\w+)\""""
    source = "".join(path.read_text() for path in SOURCE.rglob("*.py"))
    found = re.findall(asked, source)
    assert len(found) == len(re.findall(r"(?<!def )missing_extra\(", source)) > 10
    assert set(found) <= set(EXTRAS)


def test_pip_adds_an_extra_to_the_sainet_that_is_installed(tmp_path: Path):
    """Also where sainet came from a clone and no index has it."""
    needed = ("-m", "pip", "install", "--dry-run", "--no-index", "sainet[gym]")
    done = subprocess.run(
        [sys.executable, *needed],
        cwd=tmp_path,
        env={k: v for k, v in os.environ.items() if k != "PYTHONPATH"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert "already satisfied: sainet[gym]" in done.stdout, done.stdout + done.stderr


def test_commands_in_running_text_have_the_options_that_they_name():
    for page in PAGES:
        for words in map(str.split, mentions(page.read_text())):
            kind = entry._COMMANDS[words[1]]
            options = {word for word in words if word.startswith("--")} - {"--help"}
            assert options <= options_of(kind), f"{page.name}: {words}"


def options_of(kind: type) -> set[str]:
    """Options of a command, with those of settings in its fields."""
    found: set[str] = set()
    for name, hint in get_type_hints(kind).items():
        parts = [each for each in (hint, *get_args(hint)) if is_dataclass(each)]
        found |= set().union(*map(options_of, parts)) if parts else {as_option(name)}
    return found


def as_option(name: str) -> str:
    return "--" + name.replace("_", "-")


@pytest.mark.parametrize("page", COMMANDS)
def test_documented_commands_parse_and_use_distinct_folders(page: str):
    folders: dict[str, str] = {}
    for command in COMMANDS[page]:
        found = parsed()[command]
        assert found, f"{command} does not parse"
        out, asked = found
        if out:
            assert folders.setdefault(out, asked) == asked, out


def statements(code: str) -> list[str]:
    """Statements of a program, without comments and line breaks."""
    return [ast.unparse(each) for each in ast.parse(code).body]


def test_the_programs_of_the_readme_are_those_that_tests_run():
    shown = re.findall(r"^```python\n(.*?)^```", README.read_text(), re.M | re.S)
    tested = (PREDICT, OWN_DATA, CONTROL)
    assert list(map(statements, shown)) == list(map(statements, tested))


def test_the_readme_is_short():
    assert len(README.read_text().splitlines()) <= 120


def test_the_site_runs_every_page_with_python_in_it():
    _, executed = site_contents()
    with_python = {
        page.stem for page in PAGES[1:] if "\n```python\n" in page.read_text()
    }
    assert with_python <= executed
    assert "make docs" in (REPOSITORY / ".ci" / "run").read_text()


def test_every_page_of_the_site_is_in_its_contents_once():
    contents, executed = site_contents()
    listed = [name for names in contents.values() for name in names]
    found = {page.stem for page in PAGES[1:]} - {"index"} | {"results/index"}
    assert sorted(listed) == sorted(found)
    assert executed < found


def test_the_citation_file_has_the_version_of_the_package():
    text = (REPOSITORY / "CITATION.cff").read_text()
    assert re.findall(r"^version: (.+)$", text, re.MULTILINE) == [__version__]


def test_every_documented_make_target_exists():
    makefile = (REPOSITORY / "Makefile").read_text()
    targets = set(re.findall(r"^([a-z][a-z-]*):", makefile, re.MULTILINE))
    assert {"demo", "test"} <= make_targets(README.read_text())
    for page in PAGES:
        assert make_targets(page.read_text()) <= targets, page.name


def test_the_readme_names_the_test_command_that_ci_runs():
    assert "make test" in shell_lines(README.read_text())
    last = (REPOSITORY / ".ci" / "run").read_text().splitlines()[-1]
    assert last.endswith("make test")


def test_ci_shows_the_demo_before_it_installs_what_tests_need():
    lines = (REPOSITORY / ".ci" / "run").read_text().splitlines()
    steps = [line for line in lines if re.search(r"\bmake [a-z-]+$", line)]
    quiet = "PYTHONDONTWRITEBYTECODE=1"  # as in many containers; the demo broke there
    assert steps[:3] == [f"{quiet} make setup", f"{quiet} make demo", "make setup-dev"]
    assert "set -euo pipefail" in lines  # a step that fails ends the script


def test_the_reader_finds_commands():
    text = "```bash\n$ sainet demo  # all\nsainet train \\\n  sain\nmake test\n```\n"
    text += "\n    sainet bench  # all\n"
    assert commands(text) == ["sainet demo", "sainet train sain", "sainet bench"]
    assert make_targets(text + "`make check`") == {"test", "check"}
