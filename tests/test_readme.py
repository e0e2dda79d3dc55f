"""What README.md tells people to type has to exist."""

import re
import shlex
import subprocess
import sys
from functools import cache

import pytest

from support import REPOSITORY

README = REPOSITORY / "README.md"
COMMAND_LINE = "from sainet.cli import main; raise SystemExit(main())"


def shell_lines(text: str) -> list[str]:
    """Commands in ```bash blocks: continued lines joined, prompts and comments off."""
    blocks = re.findall(r"^```bash\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
    lines = "\n".join(blocks).replace("\\\n", " ").splitlines()
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


@cache
def help_of(*words: str) -> subprocess.CompletedProcess[str]:
    """What `sainet WORDS --help` answers."""
    command = [sys.executable, "-c", COMMAND_LINE, *words, "--help"]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def leading_words(arguments: list[str]) -> list[str]:
    """The subcommand: words before the first option, at most two (`generate robot`)."""
    words: list[str] = []
    for word in arguments[:2]:
        if not re.fullmatch(r"[a-z][a-z-]*", word):
            break
        words.append(word)
    return words


@pytest.mark.parametrize("command", commands(README.read_text()))
def test_a_command_of_the_readme_parses(command: str):
    arguments = shlex.split(command)[1:]
    words = leading_words(arguments)
    if words:
        answer = help_of(*words)
        assert answer.returncode == 0, answer.stdout + answer.stderr
        assert f"sainet {words[0]}" in answer.stdout, "no such subcommand"
    else:
        answer = help_of()
    options = [word.partition("=")[0] for word in arguments if word.startswith("--")]
    unknown = [option for option in options if option not in answer.stdout]
    assert not unknown, answer.stdout


def test_every_make_target_of_the_readme_exists():
    makefile = (REPOSITORY / "Makefile").read_text()
    targets = set(re.findall(r"^([a-z][a-z-]*):", makefile, re.MULTILINE))
    named = make_targets(README.read_text())
    assert {"demo", "test"} <= named
    assert named <= targets


def test_the_readme_names_the_test_command_that_ci_runs():
    assert "make test" in shell_lines(README.read_text())
    last = (REPOSITORY / ".ci" / "run").read_text().splitlines()[-1]
    assert last.endswith("make test")


def test_this_reader_of_readmes_sees_commands():
    text = "```bash\n$ sainet demo  # all\nsainet train \\\n  sain\nmake test\n```\n"
    assert commands(text) == ["sainet demo", "sainet train sain"]
    assert make_targets(text + "`make check`") == {"test", "check"}
