"""Pages, and the one way to render their templates."""

from functools import cache
from importlib import resources

import jinja2


def render(name: str, **values: object) -> str:
    """Return a template filled with values; every string in them is escaped."""
    return _environment(autoescape=True).get_template(name).render(**values)


def render_text(name: str, **values: object) -> str:
    """Return a template of plain text as one line; nothing in it is escaped."""
    text = _environment(autoescape=False).get_template(name).render(**values)
    return "".join(text.splitlines()).strip()


def read(name: str) -> str:
    """Return a style sheet or a script from the folder of templates."""
    return resources.files(__name__).joinpath("templates", name).read_text("utf-8")


@cache
def _environment(*, autoescape: bool) -> jinja2.Environment:
    return jinja2.Environment(
        loader=jinja2.FunctionLoader(read),
        autoescape=autoescape,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
