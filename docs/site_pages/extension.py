"""The Sphinx extension of the site: contents, programs that run, generated pages."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

from docutils import nodes
from sphinx.addnodes import pending_xref
from sphinx.application import Sphinx
from sphinx.environment import BuildEnvironment
from sphinx.errors import ExtensionError

from sainet.studies.pages import PAGES
from site_pages.benchmark import evidence_of, rankings
from site_pages.contents import CONTENTS, EXECUTED
from site_pages.fields import add_fields
from site_pages.reference import (
    ROOT,
    command_line,
    dataset_arrays,
    model_zoo,
    project_file,
    public_homes,
    python_interface,
)
from site_pages.tables import NAMED, body, grids, named_tables

_NOTEBOOK = """---
file_format: mystnb
kernelspec:
  name: python3
  language: python
language_info:
  name: python
  pygments_lexer: ipython3
---

"""
_BLOCK = re.compile(r"^```(python|bash)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
# Folders, and files that are no pages: GitHub shows them, the site has no copy.
_NO_PAGE = re.compile(r"\[([^\]\n]+)\]\((?:\.\./)+(?!figures|results/\w)[^)#]*\)")
# The same on pages of results, which link the pages above them.
_NO_PAGE_BELOW = re.compile(r"\[([^\]\n]+)\]\((?:\.\./){2,}[^)#]*\)")
_RESULTS = "results/"
_GENERATED = {
    "api": python_interface,
    "benchmark": lambda: rankings(ROOT),
    "changelog": lambda: project_file("CHANGELOG.md"),
    "cli": command_line,
    "data-format": dataset_arrays,
    "contributing": lambda: project_file("CONTRIBUTING.md"),
    "models": model_zoo,
}
_PAGE = re.compile(r"\]\(([\w-]+)\.md\)")  # beside a page
_PLACE = "<!-- generated -->"  # of the generated text; else it comes last
# A cell that runs commands. A kernel's own magic colours outputs and breaks lines.
_SHELL = "commands = "
_RUN = """
import os, subprocess

plain = {k: v for k, v in os.environ.items() if k not in ("FORCE_COLOR", "CLICOLOR")}
plain |= {"COLUMNS": "88", "NO_COLOR": "1", "TERM": "dumb"}
done = subprocess.run(
    ["bash", "-ec", commands], env=plain, text=True,
    stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
)
if done.stdout.strip():
    print(done.stdout)
assert done.returncode == 0, done.returncode
"""
_REMOTE = re.compile(
    r"<(?:script|img|iframe|source|video)[^>]*\ssrc=\"(?:https?:)?//"
    r"|<link[^>]*rel=\"(?:stylesheet|preload|preconnect)\"[^>]*href=\"(?:https?:)?//"
)


def setup(app: Sphinx) -> dict[str, bool]:
    """Connect the extension to Sphinx."""
    app.connect("source-read", _prepare)
    app.connect("doctree-read", _show_commands)
    app.connect("autodoc-process-docstring", add_fields)
    app.connect("autodoc-process-signature", _short_signature)
    app.connect("html-collect-pages", _complete_tables)
    app.connect("build-finished", _refuse_remote_parts)
    app.connect("missing-reference", _public_name)
    return {"parallel_read_safe": True, "parallel_write_safe": True}


def _prepare(app: Sphinx, page: str, source: list[str]) -> None:
    """Add to a page what GitHub does not show: contents, and cells that run."""
    no_page = _NO_PAGE_BELOW if page.startswith(_RESULTS) else _NO_PAGE
    text = no_page.sub(_as_text, source[0])
    if page in _GENERATED:
        generated = _NO_PAGE.sub(_as_text, _GENERATED[page]())
        before, _, after = text.partition(_PLACE)
        text = f"{before}\n{generated}{after}"
    if page in EXECUTED:
        text = _NOTEBOOK + _BLOCK.sub(_cell, text)
    if page == app.config.root_doc:
        text += "".join(_toctree(pages, name) for name, pages in CONTENTS.items())
    if page == "results/index":  # in the order of its list
        pages = Path(app.srcdir, "results").glob("*.md")
        listed = _PAGE.findall(text.partition("## Pages")[2])
        names = dict.fromkeys([*listed, *sorted(path.stem for path in pages)])
        text += _toctree([name for name in names if name != "index"])
    if page.startswith(_RESULTS):
        text = NAMED.sub(
            lambda file: f'<a href="{file[0][1:-1]}">{file[0][1:-1]}</a>', text
        )
    source[0] = text


def _complete_tables(app: Sphinx) -> Iterator[tuple[str, dict[str, str], str]]:
    """Write the complete tables as CSV, and yield the pages on which they sort."""
    folder = Path(app.outdir, Path(PAGES).name, "tables")
    folder.mkdir(parents=True, exist_ok=True)
    for name, (page, title) in named_tables(Path(app.srcdir)).items():
        summary = evidence_of(ROOT).summary(name)
        for grid in grids(name, summary):
            (folder / f"{name}{grid.suffix}.csv").write_text(grid.to_csv(), "utf-8")
        text = body(name, page, title, summary)
        shown = {"title": f"Every number: {title}", "body": text}
        yield f"{Path(PAGES).name}/tables/{name}", shown, "page.html"


def _as_text(link: re.Match[str]) -> str:
    return link[1] if link[1].startswith("`") else f"`{link[1]}`"


def _cell(block: re.Match[str]) -> str:
    language, code = block.groups()
    if language == "bash":
        code = f"{_SHELL}{code!r}\n{_RUN}"
    return f"```{{code-cell}} ipython3\n{code}```"


def _toctree(pages: list[str], caption: str = "") -> str:
    names = "\n".join(pages)
    title = f":caption: {caption}\n" if caption else ""
    return f"\n\n```{{toctree}}\n:hidden:\n{title}\n{names}\n```\n"


def _show_commands(app: Sphinx, document: nodes.document) -> None:
    """Show commands as a reader types them."""
    for block in document.findall(nodes.literal_block):
        text = block.astext()
        if text.startswith(_SHELL):
            literal = text.removeprefix(_SHELL).partition("\n")[0]
            shown = ast.literal_eval(literal)
            block.rawsource = shown
            block.children = [nodes.Text(shown)]
            block["language"] = "bash"


def _short_signature(
    app: Sphinx, what: str, *rest: object
) -> tuple[str | None, str | None]:
    """Return the arguments and the result of a signature, without JAX's modules."""
    arguments, result = rest[-2:]
    return _without_modules(arguments), _without_modules(result)


def _without_modules(text: object) -> str | None:
    return text.replace("jaxlib._jax.", "") if isinstance(text, str) else None


def _public_name(
    app: Sphinx, env: BuildEnvironment, node: pending_xref, shown: nodes.Element
) -> nodes.Element | None:
    """Link a type by the public name that documents it."""
    name = node.get("reftarget", "").rpartition(".")[2]
    if node.get("refdomain") != "py" or name not in public_homes():
        return None
    python = env.domains.python_domain
    return python.resolve_xref(
        env, node["refdoc"], app.builder, "obj", f"sainet.{name}", node, shown
    )


def _refuse_remote_parts(app: Sphinx, failure: Exception | None) -> None:
    """Fail if a built page would load something from the network."""
    if failure is None and app.builder.format == "html":
        for page in Path(app.outdir).rglob("*.html"):
            if found := _REMOTE.search(page.read_text("utf-8")):
                raise ExtensionError(f"{page} loads a remote file: {found[0]}")
