"""The columns of an importable table, drawn on the table that they describe."""

from pathlib import Path

from matplotlib.axes import Axes

from sainet.report.figures.canvas import house_look, save
from sainet.report.palette import INK, MOVED, PUSHED
from sainet.report.pictures.drawing import (
    FAINT,
    GROUND,
    Point,
    arc,
    arrow,
    bare_axes,
    disk,
    line,
    note,
    polar,
)

_RED, _BLUE, _RADIUS = (0.30, 0.16), (0.405, 0.19), 0.0525
_PUSHER, _PUSHER_RADIUS = (0.241, 0.146), 0.005
_ANGLE = 35.0  # degrees, of the body `red`


def draw_table_columns(path: Path) -> Path:
    """Draw where x, y, angle, pusher_x and pusher_y of one row are measured (m)."""
    with house_look():
        figure, axes = bare_axes(7.4, 3.9, (-0.075, 0.6), (-0.055, 0.3))
        axes.fill([0, 0.585, 0.585, 0], [0, 0, 0.28, 0.28], color=GROUND)
        arrow(axes, (0, 0), (0.55, 0))
        arrow(axes, (0, 0), (0, 0.25))
        note(axes, (0.555, -0.014), "x (m)", align="left", size=8)
        note(axes, (0, 0.265), "y (m)", size=8)
        note(axes, (-0.008, -0.012), "origin", align="right", size=8, color=FAINT)
        disk(axes, _RED, _RADIUS, PUSHED)
        disk(axes, _BLUE, _RADIUS, MOVED)
        disk(axes, _PUSHER, _PUSHER_RADIUS, INK)
        note(
            axes,
            (_PUSHER[0] - 0.008, _PUSHER[1] + 0.03),
            "pusher",
            align="right",
            size=8,
        )
        _draw_angle(axes)
        _draw_place(axes, _RED, ("x", "y"), PUSHED)
        _draw_place(axes, _PUSHER, ("pusher_x", "pusher_y"), INK)
        note(axes, (_RED[0], _RED[1] + 0.068), "body = red", color=PUSHED, bold=True)
        note(
            axes,
            (_BLUE[0] + 0.01, _BLUE[1] + 0.067),
            "body = blue",
            color=MOVED,
            bold=True,
        )
        note(axes, (0.44, 0.10), "one row for each push,", align="left", size=8)
        note(axes, (0.44, 0.083), "time and body: red and", align="left", size=8)
        note(axes, (0.44, 0.066), "blue have rows of their own", align="left", size=8)
        return save(figure, path)


def _draw_angle(axes: Axes) -> None:
    line(axes, _RED, (_RED[0] + 0.045, _RED[1]), PUSHED)
    arrow(axes, _RED, polar(_RED, _RADIUS, _ANGLE), PUSHED)
    arc(axes, _RED, 0.028, (0, _ANGLE), PUSHED)
    note(axes, (_RED[0] + 0.006, _RED[1] + 0.036), "angle", color=PUSHED, size=8.5)


def _draw_place(axes: Axes, place: Point, names: tuple[str, str], color: str) -> None:
    """Draw the lines from a centre to both axes, with the names of the columns."""
    x, y = place
    axes.plot(*place, "o", color=color, markersize=4)
    line(axes, place, (x, 0), color)
    line(axes, place, (0, y), color)
    note(axes, (x, -0.014), names[0], color=color, bold=True)
    note(axes, (-0.006, y), names[1], color=color, align="right", bold=True)
