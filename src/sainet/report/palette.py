"""One colour, one dash and one label for each model, wherever it is drawn.

Truth, physics and SAIN are solid lines, in ink and in an orange and a bluish green that
common colour blindness tells apart; every other model has a dash of its own. Each
colour has a lighter twin for dark pages.
"""

import zlib
from collections.abc import Iterable
from dataclasses import dataclass

from sainet.models.identity import ModelId

INK = "#2f3437"  # text, axes and the truth
PAPER = "#ffffff"
DARK_INK = "#e4e2dd"
DARK_PAPER = "#16191d"
# Disks of an episode, as in the paper's figure: pushed red, moved blue, goal yellow.
PUSHED, MOVED, OTHER, TARGET = "#c8553d", "#2a6fb5", "#8b8f94", "#f0c808"
_EPISODE = {
    "--pushed": (PUSHED, "#ef8a72"),
    "--moved": (MOVED, "#6fb0ee"),
    "--other": (OTHER, "#9aa0a6"),
    "--target": (TARGET, "#d9b40a"),
}
_LONGEST = 40  # characters; a longer given name, such as a folder, keeps its end


@dataclass(frozen=True)
class ModelStyle:
    """How a model is drawn: ``color`` on light pages, ``dark`` on dark ones."""

    name: str
    label: str
    color: str  # #rrggbb
    dark: str  # #rrggbb
    dash: tuple[float, ...] = ()  # on, off, ... in line widths; empty: solid

    @property
    def variable(self) -> str:
        """The CSS variable that holds the colour of the page's theme."""
        return f"--model-{self.color[1:]}"


_KNOWN = {
    style.name: style
    for style in (
        ModelStyle("truth", "Truth", INK, DARK_INK),
        ModelStyle("physics", "Physics", "#dd7110", "#f2994a"),
        ModelStyle(
            "physics-true", "Physics, true properties", "#b8964a", "#d9bf7c", (4, 2)
        ),
        ModelStyle("in", "IN", "#2a6fb5", "#6fb0ee", (7, 2)),
        ModelStyle("sain", "SAIN", "#00917a", "#35c7a8"),
        ModelStyle("sain-bullet", "SAIN around Bullet", "#5f8f2f", "#98c766", (5, 1.5)),
        ModelStyle(
            "sain-true", "SAIN, true properties", "#3f7f8c", "#7cc3d1", (3, 1.5)
        ),
    )
}
_SPARE = (
    ("#8a5aa8", "#c39be0", (2, 1.5)),
    ("#b8416f", "#e25a7c", (1, 1)),
    ("#5b6b7f", "#a3b4c9", (6, 1.5, 1, 1.5)),
    ("#8c4a2f", "#d6957a", (4, 1.5, 1, 1.5, 1, 1.5)),
    ("#4453a6", "#9aa6ec", (9, 3)),
    ("#7a7d1f", "#c3c76a", (2, 1, 2, 3)),
)


def styles_of(
    names: Iterable[str], models: Iterable[ModelId] = ()
) -> dict[str, ModelStyle]:
    """Return the style of each name, in order.

    A model without a style of its own gets a spare colour and its dash, chosen by
    its name, or the next free ones if another model here has them already.

    Args:
        names: slugs of models.
        models: give the labels of names that the palette lacks; the label of any other
            name is the name.
    """
    styles: dict[str, ModelStyle] = {}
    labels = labels_of(models)
    taken: set[int] = set()
    for name in names:
        if name in styles:
            continue
        label = labels.get(name, _shortened(name))
        styles[name] = _KNOWN.get(name) or _spare_style(name, label, taken)
    return styles


def style_of(name: str) -> ModelStyle:
    """Return the style of a single model."""
    return styles_of([name])[name]


def css_variables(*, dark: bool) -> dict[str, str]:
    """Return every colour of the palette by the name of its CSS variable."""
    ink, paper = (DARK_INK, DARK_PAPER) if dark else (INK, PAPER)
    pairs = [(style.color, style.dark) for style in _KNOWN.values()]
    pairs += [spare[:2] for spare in _SPARE]
    variables = {f"--model-{pair[0][1:]}": pair[dark] for pair in pairs}
    disks = {name: pair[dark] for name, pair in _EPISODE.items()}
    return {"--ink": ink, "--paper": paper, **disks, **variables}


def _spare_style(name: str, label: str, taken: set[int]) -> ModelStyle:
    slot = zlib.crc32(name.encode()) % len(_SPARE)
    while slot in taken and len(taken) < len(_SPARE):
        slot = (slot + 1) % len(_SPARE)
    taken.add(slot)
    color, dark, dash = _SPARE[slot]
    return ModelStyle(name, label, color, dark, dash)


def labels_of(models: Iterable[ModelId]) -> dict[str, str]:
    """Return the label of each model by its slug; a given name may be shortened."""
    return {m.slug: _shortened(m.name) if m.name else m.label for m in models}


def _shortened(name: str) -> str:
    return name if len(name) <= _LONGEST else f"…{name[1 - _LONGEST :]}"
