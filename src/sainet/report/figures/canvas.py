"""The common style of all figures, and their saving."""

from collections.abc import Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any, Literal, TypedDict

import matplotlib
import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.ticker import Locator, NullFormatter
from matplotlib.transforms import Affine2D, ScaledTranslation

from sainet.report.palette import INK, PAPER, ModelStyle
from sainet.runs.documents import atomic_path

_LOOK: dict[Any, Any] = {
    "axes.edgecolor": INK,
    "axes.labelcolor": INK,
    "axes.labelsize": 9,
    "axes.linewidth": 0.6,
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.titlelocation": "left",
    "axes.titlepad": 10,
    "axes.titlesize": 10,
    "axes.titleweight": "bold",
    "figure.facecolor": PAPER,
    "font.size": 9,
    "legend.fontsize": 8.5,
    "legend.frameon": False,
    "lines.solid_capstyle": "round",
    "svg.fonttype": "none",  # text stays text: searchable, in the font of the page
    "svg.hashsalt": "sainet",  # the same figure has the same bytes
    "text.color": INK,
    "text.parse_math": False,  # a name may hold a dollar sign
    "xtick.color": INK,
    "xtick.labelsize": 8,
    "xtick.major.width": 0.6,
    "ytick.color": INK,
    "ytick.labelsize": 8,
    "ytick.major.width": 0.6,
}
_METADATA = {".svg": {"Date": None, "Creator": None}, ".png": {"Software": None}}
DOTS_PER_INCH = 200
_LABEL_HEIGHT = 12.5  # points
_PIECE = (7, 27)  # points right of the axes: of the line, before its label


def house_look() -> AbstractContextManager[None]:
    """Return a context in which new figures have the common style."""
    return matplotlib.rc_context(_LOOK)


def new_figure(width: float, height: float) -> Figure:
    """Return an empty figure of a size (inches), laid out without overlaps."""
    return Figure(figsize=(width, height), layout="constrained")


def name_panels(figure: Figure) -> None:
    """Name the panels of a row by their place and width (points), for wrapping."""
    figure.draw_without_rendering()
    for axes in figure.axes:
        ends = axes.get_tightbbox().intervalx  # type: ignore[union-attr]
        left, right = 72 / figure.dpi * np.maximum(ends, 0)
        axes.set_gid(f"panel-{left:.1f}-{right - left:.1f}")


def save(figure: Figure, path: Path) -> Path:
    """Write a figure in the format of its suffix, atomically."""
    suffix = path.suffix.lower()
    with atomic_path(path) as draft:
        figure.savefig(
            draft, format=suffix[1:], dpi=DOTS_PER_INCH, metadata=_METADATA.get(suffix)
        )
    return path


class LineLook(TypedDict, total=False):
    """Matplotlib's keywords for a line; lengths in points."""

    color: str
    linewidth: float
    alpha: float
    linestyle: Literal[":"]
    dashes: tuple[float, ...]
    dash_capstyle: Literal["butt"]
    marker: str
    markersize: float
    markerfacecolor: str


def line_look(style: ModelStyle, width: float = 1.6) -> LineLook:
    """Return the look of the line of a model."""
    look = LineLook(color=style.color, linewidth=width)
    if style.dash:
        look |= LineLook(dashes=style.dash, dash_capstyle="butt")
    return look


def add_grid(axes: Axes, axis: str = "y") -> None:
    """Draw faint lines behind the data, along one axis or both."""
    axes.grid(axis=axis, color=INK, alpha=0.12, linewidth=0.6)  # type: ignore[arg-type]
    axes.set_axisbelow(True)


def number_ticks(axis: Axis, locator: Locator) -> None:
    """Write plain numbers at the major ticks of a logarithmic axis, and no others."""
    axis.set_major_locator(locator)
    axis.set_major_formatter("{x:g}")
    axis.set_minor_formatter(NullFormatter())


def label_ends(
    axes: Axes, styles: Sequence[ModelStyle], ends: Sequence[tuple[float, float]]
) -> None:
    """Write each model's label next to the end of its line, without overlaps.

    A piece of the line precedes each label, because lines may share their end.

    Args:
        axes: axes with their final limits and scales.
        styles: of the lines.
        ends: the last point of each line, in the units of the axes; a line that
            ends in NaN gets no label.
    """
    known = [pair for pair in zip(styles, ends, strict=True) if np.isfinite(pair[1][1])]
    if not known:
        return
    styles, ends = zip(*known, strict=True)
    pixels = axes.transData.transform(np.asarray(ends, float))
    box = axes.get_window_extent()
    in_points = Affine2D().scale(1 / 72) + axes.figure.dpi_scale_trans  # type: ignore[union-attr]
    gap = _LABEL_HEIGHT * axes.figure.dpi / 72  # type: ignore[union-attr]
    heights = spread(pixels[:, 1], gap)
    for style, end, height in zip(styles, ends, heights, strict=True):
        axes.plot(*end, "o", color=style.color, markersize=4, clip_on=False)
        up = (height - box.y0) / box.height
        to_end = ScaledTranslation(1, up, axes.transAxes)  # type: ignore[arg-type]
        look = line_look(style, 1.4)
        axes.plot(_PIECE, (0, 0), transform=in_points + to_end, clip_on=False, **look)
        axes.annotate(
            style.label,
            xy=(1, up),
            xycoords="axes fraction",
            xytext=(_PIECE[1] + 5, 0),
            textcoords="offset points",
            va="center",
        )


def spread(wanted: Float[np.ndarray, " n"], gap: float) -> Float[np.ndarray, " n"]:
    """Return positions near the wanted positions, in order and at least a gap apart.

    Overlapping neighbours become a block centred at their wanted positions.
    """
    order = np.argsort(wanted, kind="stable")
    blocks: list[list[float]] = []  # each: sum of the wanted starts, members
    for rank, index in enumerate(order):
        blocks.append([float(wanted[index]) - rank * gap, 1])
        while len(blocks) > 1 and _mean(blocks[-2]) > _mean(blocks[-1]):
            total, members = blocks.pop()
            blocks[-1] = [blocks[-1][0] + total, blocks[-1][1] + members]
    starts = [_mean(block) for block in blocks for _ in range(int(block[1]))]
    places = np.empty(len(order))
    places[order] = np.asarray(starts) + gap * np.arange(len(order))
    return places


def _mean(block: list[float]) -> float:
    return block[0] / block[1]
