"""Commands and make targets in README.md and docs/ exist."""

import ast
import json
import re
import runpy
import shlex
import subprocess
import sys
from functools import lru_cache

import pytest

from api.programs import CONTROL, OWN_DATA, PREDICT
from sainet import __version__
from support import REPOSITORY

README = REPOSITORY / "README.md"


def shell_lines(text: str) -> list[str]:
    """Commands in ```bash blocks: continued lines joined, prompts and comments off.

    In blocks that are indented instead, what begins with `sainet` or `make`.
    """
    blocks = re.findall(r"^```bash\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
    blocks += re.findall(r"^    ((?:sainet|make) .*)", text, re.MULTILINE)
    lines = "\n".join(blocks).replace("\\\n", " ").splitlines()
    lines = [line.partition(" > ")[0] for line in lines]  # into a file
    words = (shlex.split(line.removeprefix("$ "), comments=True) for line in lines)
    return [shlex.join(line) for line in words if line]


def commands(text: str) -> list[str]:
    """Calls of `sainet` in the text, each once."""
    found = (line for line in shell_lines(text) if line.startswith("sainet "))
    return list(dict.fromkeys(found))


def make_targets(text: str) -> set[str]:
    """Targets of every `make X` in the text, in blocks and in running text."""
    typed = "\n".join(shell_lines(text))
    inline = re.findall(r"`make ([a-z][a-z-]*)", text)
    return {*inline, *re.findall(r"^make ([a-z][a-z-]*)", typed, re.MULTILINE)}


PAGES = [README, *sorted((REPOSITORY / "docs").glob("*.md"))]
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


def site_contents() -> tuple[dict[str, list[str]], set[str]]:
    """Return the pages of the site by section, and the pages that `make docs` runs."""
    path = REPOSITORY / "docs" / "site_pages" / "contents.py"
    found = runpy.run_path(str(path))
    return found["CONTENTS"], found["EXECUTED"]


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


def test_the_reader_finds_commands():
    text = "```bash\n$ sainet demo  # all\nsainet train \\\n  sain\nmake test\n```\n"
    text += "\n    sainet bench  # all\n"
    assert commands(text) == ["sainet demo", "sainet train sain", "sainet bench"]
    assert make_targets(text + "`make check`") == {"test", "check"}
