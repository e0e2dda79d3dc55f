"""Figures as parts of a page: checked, named apart, in the colours of its theme."""

import re
from pathlib import Path
from xml.etree import ElementTree

from markupsafe import Markup

from sainet.report.palette import css_variables
from sainet.runs.errors import BadInput

_PIXELS_PER_POINT = 1.4
# What a figure of this package is made of.
_SHAPES = ("svg", "defs", "style", "g", "path", "use", "text", "clipPath", "rect")
_ATTRIBUTES = {
    *("id", "style", "type", "version", "viewBox", "width", "height", "x", "y", "d"),
    *("transform", "clip-path", "href"),
}
# In CSS: what is loaded from elsewhere, and escapes, with which it could be hidden.
_REFERS_OUTSIDE = re.compile(r"url\(\s*(?!#)|@|\\", re.IGNORECASE)
_NAMESPACES = {
    "": "http://www.w3.org/2000/svg",
    "xlink": "http://www.w3.org/1999/xlink",
}


def read_svg(path: Path) -> str:
    """Read a figure that this package drew.

    What is returned is written anew from what was checked: comments and declarations,
    in which more could hide, are gone.

    Raises:
        BadInput: it is none: it might do something in the page.
    """
    try:
        figure = ElementTree.fromstring(path.read_text("utf-8"))
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
                f"{path}: <{name}> is nothing that sainet draws; delete the file or "
                "take it out of the folder."
            )
    for prefix, name in _NAMESPACES.items():
        ElementTree.register_namespace(prefix, name)
    return ElementTree.tostring(figure, "unicode")


def _is_plain(attribute: tuple[str, str]) -> bool:
    """Whether an attribute does nothing and refers to nothing outside."""
    name, value = attribute[0].rpartition("}")[2], attribute[1]
    if name not in _ATTRIBUTES or (name == "href" and not value.startswith("#")):
        return False
    return not _REFERS_OUTSIDE.search(value)


def inline_svg(text: str, number: int) -> Markup:
    """Return an SVG fit to stand inside a page.

    Its identifiers get a prefix, so that two figures do not mix them up, and the
    colours of the palette become variables, which follow the theme of the page.
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
    """Limit the width, so that the text of all figures has the same size."""
    width = float(opening[2]) * _PIXELS_PER_POINT
    return f'<svg style="max-width: {width:.0f}px"{opening[1]} width="{opening[2]}pt"'
