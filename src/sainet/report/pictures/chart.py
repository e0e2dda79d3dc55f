"""A decision chart: which model to use for pushes of one's own."""

from pathlib import Path
from typing import NamedTuple

from matplotlib.axes import Axes

from sainet.report.figures.canvas import house_look, save
from sainet.report.palette import INK, style_of
from sainet.report.pictures.drawing import Point, arrow, bare_axes, box, note

_SIZE = (3.5, 1.0)
_STEP = 1.75  # between the rows of the chart
_ACROSS = 5.6  # from a question to its answer


class _Choice(NamedTuple):
    """A question, what to use if the answer is yes, and the model of that colour."""

    question: tuple[str, str]
    answer: tuple[str, str]
    model: str


_CHOICES = (
    _Choice(
        ("Are the errors of physics-true", "small enough?"),
        ("Use physics-true: the engine", "with your masses and radii"),
        "physics-true",
    ),
    _Choice(
        ("Are they small enough", "after sainet identify?"),
        ("Use the identified engine:", "it needs few pushes"),
        "physics",
    ),
    _Choice(
        ("Do all pushes happen at one", "place of one table?"),
        ("Fit a Gaussian process", "with the place as an input"),
        "sain-true",
    ),
    _Choice(
        ("Do test pushes show that a", "learned model errs clearly less?"),
        ("Use it: a Gaussian process,", "or a tuned SAIN or IN"),
        "sain",
    ),
)
_OTHERWISE = ("Keep the identified engine,", "or record more pushes")


def draw_chart(path: Path) -> Path:
    """Draw the questions from top to bottom, each with its answer on the right."""
    bottom = -_STEP * len(_CHOICES)
    with house_look():
        figure, axes = bare_axes(6.6, 6.1, (-0.1, 9.3), (bottom - 0.1, 1.2))
        for row, choice in enumerate(_CHOICES):
            corner = (0.0, -_STEP * row)
            _draw(axes, corner, choice.question, INK)
            color = style_of(choice.model).color
            _draw(axes, (_ACROSS, corner[1]), choice.answer, color)
            middle = corner[1] + _SIZE[1] / 2
            arrow(axes, (_SIZE[0], middle), (_ACROSS, middle), color)
            note(axes, ((_SIZE[0] + _ACROSS) / 2, middle + 0.2), "yes", color=color)
            across = _SIZE[0] / 2
            arrow(axes, (across, corner[1]), (across, corner[1] - _STEP + _SIZE[1]))
            note(axes, (across + 0.3, corner[1] - 0.35), "no")
        _draw(axes, (0.0, bottom), _OTHERWISE, style_of("physics").color)
        return save(figure, path)


def _draw(axes: Axes, corner: Point, lines: tuple[str, str], color: str) -> None:
    box(axes, corner, _SIZE, color)
    middle = corner[0] + _SIZE[0] / 2
    for up, text in zip((0.65, 0.32), lines, strict=True):
        note(axes, (middle, corner[1] + up), text, size=8.5)
