"""The templates of the report, and the one way to render them: autoescape on."""

from functools import cache
from importlib import resources
from typing import Any

import jinja2


def render(name: str, **values: Any) -> str:  # noqa: ANN401
    """Return a template filled with values; every string in them is escaped."""
    return _environment().get_template(name).render(**values)


def render_text(name: str, **values: Any) -> str:  # noqa: ANN401
    """Return a template of plain text as one line; nothing in it is escaped."""
    lines = _plain().get_template(name).render(**values).splitlines()
    return "".join(lines).strip()


def read(name: str) -> str:
    """Return a style sheet or a script that lies beside the templates."""
    return resources.files(__name__).joinpath(name).read_text("utf-8")


@cache
def _environment() -> jinja2.Environment:
    return _made(autoescape=True)


@cache
def _plain() -> jinja2.Environment:
    return _made(autoescape=False)


def _made(*, autoescape: bool) -> jinja2.Environment:
    return jinja2.Environment(
        loader=jinja2.FunctionLoader(read),
        autoescape=autoescape,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
