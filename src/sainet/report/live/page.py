"""The files of the page, and which requests the server answers."""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib import resources

import jinja2
import msgspec

from sainet.report.live.config import DISK_COUNTS, PlayConfig
from sainet.report.palette import ModelStyle, css_variables, styles_of

SOCKET = "/live"
_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src data:; "
    "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
_HEADERS = {
    "Content-Security-Policy": _POLICY,
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cache-Control": "no-store",
    "Connection": "close",
}


@dataclass(frozen=True)
class Asset:
    """A file of the page."""

    kind: str  # MIME type
    body: bytes

    @property
    def headers(self) -> Mapping[str, str]:
        """The headers of the answer."""
        length = str(len(self.body))
        kind = f"{self.kind}; charset=utf-8"
        return {**_HEADERS, "Content-Type": kind, "Content-Length": length}


def assets(config: PlayConfig) -> Mapping[str, Asset]:
    """Return the files of the page by their paths."""
    styles = styles_of(config.model)
    models = [_drawn(styles, name) for name in styles]
    page = _render(
        "play.html.j2",
        config=config,
        models=[msgspec.to_builtins(model) for model in models],
        model_options=[(model.name, model.label) for model in models],
        count_options=[(count, count) for count in DISK_COUNTS],
    )
    css = _render(
        "play.css.j2",
        light=css_variables(dark=False),
        dark=css_variables(dark=True),
        styles=models,
    )
    scripts = {f"/{name}": Asset("text/javascript", _read(name)) for name in _SCRIPTS}
    return {
        "/": Asset("text/html", page.encode()),
        "/play.css": Asset("text/css", css.encode()),
        **scripts,
    }


class DrawnModel(msgspec.Struct):
    """How the page draws a model."""

    id: str  # in elements and classes
    name: str  # in messages
    label: str
    variable: str  # of CSS, with the colour
    dash: str  # of outlines, in pixels


def _drawn(styles: Mapping[str, ModelStyle], name: str) -> DrawnModel:
    """Return a model whose elements are named for it, or for its place in the list."""
    style = styles[name]
    known = re.fullmatch("[a-z-]+", name) is not None
    id = name if known else f"model{list(styles).index(name) + 1}"
    dash = " ".join(f"{1.5 * length:g}" for length in style.dash)
    return DrawnModel(id, name, style.label, style.variable, dash or "none")


_SCRIPTS = ("play.js", "table.js", "geometry.js", "panel.js")


def _read(name: str) -> bytes:
    folder = resources.files("sainet.report.live").joinpath("templates")
    return folder.joinpath(name).read_bytes()


def _render(name: str, **values: object) -> str:
    return _environment().get_template(name).render(**values)


@cache
def _environment() -> jinja2.Environment:
    return jinja2.Environment(
        loader=jinja2.FunctionLoader(lambda name: _read(name).decode()),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
