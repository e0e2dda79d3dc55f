"""Figures as parts of a page: checked, with unique names and theme colours."""

import re
from pathlib import Path
from xml.etree import ElementTree

from markupsafe import Markup

from sainet.report.palette import css_variables
from sainet.runs.documents import read_file
from sainet.runs.errors import BadInput

_PIXELS_PER_POINT = 1.4
# Elements and attributes of figures drawn by this package.
_SHAPES = ("svg", "defs", "style", "g", "path", "use", "text", "clipPath", "rect")
_ATTRIBUTES = {
    *("id", "style", "type", "version", "viewBox", "width", "height", "x", "y", "d"),
    *("transform", "clip-path", "href"),
}
# CSS that loads external content, and escapes that could hide it.
_REFERS_OUTSIDE = re.compile(r"url\(\s*(?!#)|@|\\", re.IGNORECASE)
_NAMESPACES = {
    "": "http://www.w3.org/2000/svg",
    "xlink": "http://www.w3.org/1999/xlink",
}


def read_svg(path: Path) -> str:
    """Return a checked figure that this package drew.

    The result is rebuilt from its checked parts, without comments and declarations,
    which could hide other content.

    Raises:
        BadInput: the file contains anything else, which might act in the page.
    """
    try:
        figure = ElementTree.fromstring(read_file(path).decode())
    except (OSError, ValueError, ElementTree.ParseError) as error:
        raise BadInput(f"{path}: cannot be read as a figure ({error}).") from None
    for about in figure.findall(f"{{{_NAMESPACES['']}}}metadata"):
        figure.remove(about)
    for part in figure.iter():
        name = part.tag.rpartition("}")[2]
        rules = part.text or "" if name == "style" else ""
        plain = all(map(_is_plain, part.attrib.items()))
        if name not in _SHAPES or not plain or _REFERS_OUTSIDE.search(rules):
            raise BadInput(
                f"{path}: <{name}> does not occur in figures of sainet; delete or move "
                "the file."
            )
    for prefix, name in _NAMESPACES.items():
        ElementTree.register_namespace(prefix, name)
    return ElementTree.tostring(figure, "unicode")


def _is_plain(attribute: tuple[str, str]) -> bool:
    """Return whether an attribute has no action and no external reference."""
    name, value = attribute[0].rpartition("}")[2], attribute[1]
    if name not in _ATTRIBUTES or (name == "href" and not value.startswith("#")):
        return False
    return not _REFERS_OUTSIDE.search(value)


def inline_svg(text: str, number: int) -> Markup:
    """Return an SVG as part of a page.

    Identifiers get a prefix, so that they are unique among figures. The colours of
    the palette become variables, which follow the theme of the page.
    """
    svg = text[text.index("<svg") :]
    svg = re.sub(r"<metadata>.*?</metadata>|<!--.*?-->", "", svg, flags=re.DOTALL)
    svg = re.sub(r'\bid="', f'id="figure-{number}-', svg)
    svg = re.sub(r'(href="#|url\(#)', rf"\1figure-{number}-", svg)
    svg = re.sub(r'^<svg([^>]*?) width="([\d.]+)pt"', _at_reading_size, svg)
    variables = css_variables(dark=False)
    for name, color in sorted(variables.items(), reverse=True):
        svg = svg.replace(color, f"var({name})")
    return Markup(svg)


def _at_reading_size(opening: re.Match[str]) -> str:
    """Return the figure with a limited width, so that all text has one size."""
    width = float(opening[2]) * _PIXELS_PER_POINT
    return f'<svg style="max-width: {width:.0f}px"{opening[1]} width="{opening[2]}pt"'
