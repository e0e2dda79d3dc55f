"""Fields of a class with their types and the comments that state their units."""

import ast
import inspect
import re
from textwrap import dedent
from typing import cast

from sphinx.application import Sphinx

_COMMENT = re.compile(r"#\s*(.+?)\s*$")


def add_fields(app: Sphinx, what: str, _name: str, item: object, *rest: object) -> None:
    """Append a list of the fields to the docstring of a class, the last argument.

    Docstrings with a section of attributes have one already.
    """
    lines = cast(list[str], rest[-1])
    is_listed = "Attributes:" in (getattr(item, "__doc__", None) or "")
    if what == "class" and isinstance(item, type) and not is_listed:
        found = list(_fields(item))
        if found:
            lines += ["", "**Fields**", "", *found, ""]


def _fields(item: type) -> list[str]:
    """Return one line of reStructuredText for each annotated public field."""
    source = dedent(inspect.getsource(item))
    text = source.splitlines()
    (definition,) = ast.parse(source).body
    assert isinstance(definition, ast.ClassDef)
    rows: list[str] = []
    body = definition.body
    for statement, following in zip(body, [*body[1:], None], strict=True):
        match statement:
            case ast.AnnAssign(target=ast.Name(id=name)) if not name.startswith("_"):
                kind = ast.unparse(statement.annotation)
                note = _note(following) or _comment(text, statement)
                rows.append(f"- ``{name}``: ``{kind}``" + (f", {note}" if note else ""))
            case _:
                pass
    return rows


def _note(following: ast.stmt | None) -> str:
    match following:
        case ast.Expr(value=ast.Constant(value=str(note))):
            return " ".join(note.split()).replace("*", r"\*")
        case _:
            return ""


def _comment(text: list[str], statement: ast.AnnAssign) -> str:
    line = text[(statement.end_lineno or statement.lineno) - 1]
    found = _COMMENT.search(line[statement.end_col_offset :])
    comment = found[1] if found else ""
    return "" if comment.startswith(("noqa", "type:", "pyright")) else comment
