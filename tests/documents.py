"""Commands and programs that README.md and the pages of docs/ show."""

import ast
import re
import runpy
import shlex
import textwrap

from support import REPOSITORY

README = REPOSITORY / "README.md"
PAGES = [README, *sorted((REPOSITORY / "docs").glob("*.md"))]


def shell_lines(text: str) -> list[str]:
    """Commands in ```bash blocks: continued lines joined, prompts and comments off.

    In blocks that are indented instead, what begins with `sainet` or `make`.
    """
    blocks = re.findall(r"^ *```bash\n(.*?)^ *```", text, re.MULTILINE | re.DOTALL)
    blocks += re.findall(r"^ {4,}((?:sainet|make) .*)", text, re.MULTILINE)
    lines = "\n".join(blocks).replace("\\\n", " ").splitlines()
    lines = [line.partition(" > ")[0] for line in lines]  # into a file
    words = (shlex.split(line.removeprefix("$ "), comments=True) for line in lines)
    return [shlex.join(line) for line in words if line]


def commands(text: str) -> list[str]:
    """Calls of `sainet` in the text, each once."""
    found = (line for line in shell_lines(text) if line.startswith("sainet "))
    return list(dict.fromkeys(found))


def mentions(text: str) -> list[str]:
    """Calls of `sainet` in running text, which may leave out what is required."""
    return re.findall(r"`(sainet [a-z][^`]*)`", text)


def make_targets(text: str) -> set[str]:
    """Targets of every `make X` in the text, in blocks and in running text."""
    typed = "\n".join(shell_lines(text))
    inline = re.findall(r"`make ([a-z][a-z-]*)", text)
    return {*inline, *re.findall(r"^make ([a-z][a-z-]*)", typed, re.MULTILINE)}


def without_indented(text: str) -> str:
    """The text without blocks that are indented, which the site does not run."""
    return re.sub(r"^ {4,}.*$", "", text, flags=re.MULTILINE)


def site_contents() -> tuple[dict[str, list[str]], set[str]]:
    """Return the pages of the site by section, and the pages that `make docs` runs."""
    path = REPOSITORY / "docs" / "site_pages" / "contents.py"
    found = runpy.run_path(str(path))
    return found["CONTENTS"], found["EXECUTED"]


def indented_program(text: str) -> str:
    """The indented blocks of a page that use sainet in Python, joined."""
    text = re.sub(r"^ *```.*?^ *```$", "", text, flags=re.MULTILINE | re.DOTALL)
    blocks = re.findall(r"((?:^(?: {4}.*)?\n)+)", text, re.MULTILINE)
    return "".join(filter(_is_python, map(textwrap.dedent, blocks)))


def _is_python(block: str) -> bool:
    """Whether a block is a program that uses sainet."""
    try:
        ast.parse(block)
    except SyntaxError:
        return False
    return re.search(r"\bsn\.|import open_store", block) is not None
