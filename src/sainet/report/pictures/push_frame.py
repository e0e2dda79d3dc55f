"""Contact angle, push direction and push frame of one push, as a picture."""

from pathlib import Path

from matplotlib.axes import Axes

from sainet.report.figures.canvas import house_look, new_figure, save
from sainet.report.palette import INK, MOVED, PUSHED
from sainet.report.pictures.drawing import (
    FAINT,
    arc,
    arrow,
    disk,
    line,
    note,
    polar,
    prepare,
)

# One push, drawn with the sizes of the paper (mm, degrees).
_RADIUS, _NEXT, _PUSHER = 54.0, 59.0, 7.0
_AXIS, _CONTACT, _DIRECTION = 18.0, 40.0, -22.0
_DISK_1 = (0.0, 0.0)


def draw_push_frame(path: Path) -> Path:
    """Draw the angles that describe a push, and the frame in which networks predict."""
    with house_look():
        figure = new_figure(8.6, 3.7)
        left, right = figure.subplots(1, 2)
        for axes, title in ((left, "The angles of a push"), (right, "The push frame")):
            prepare(axes, (-125, 178), (-122, 126))
            note(axes, (-125, 117), title, size=10, align="left", bold=True)
        _draw_angles(left)
        _draw_frame(right)
        return save(figure, path)


def _draw_disks(axes: Axes) -> tuple[float, float]:
    """Draw both disks and the pusher; return the centre of the pusher."""
    disk(axes, _DISK_1, _RADIUS, PUSHED)
    disk_2 = polar(_DISK_1, _RADIUS + _NEXT, _AXIS)
    disk(axes, disk_2, _NEXT, MOVED)
    note(axes, polar(_DISK_1, 37, -58), "disk 1", color=PUSHED)
    note(axes, (disk_2[0] + 12, disk_2[1] + 14), "disk 2", color=MOVED)
    pusher = polar(_DISK_1, _RADIUS + _PUSHER, 180 + _AXIS + _CONTACT)
    disk(axes, pusher, _PUSHER, INK)
    return pusher


def _draw_angles(axes: Axes) -> None:
    pusher = _draw_disks(axes)
    back, normal = 180 + _AXIS, _AXIS + _CONTACT
    line(axes, polar(_DISK_1, 105, back), polar(_DISK_1, 190, _AXIS))
    note(axes, (-118, -8), "axis from disk 1", size=8, color=FAINT, align="left")
    note(axes, (-118, -24), "to disk 2", size=8, color=FAINT, align="left")
    line(axes, pusher, polar(_DISK_1, 96, normal))
    note(axes, polar(_DISK_1, 107, normal + 4), "contact normal", size=8, color=FAINT)
    arc(axes, _DISK_1, 26, (back, back + _CONTACT))
    note(axes, polar(_DISK_1, 36, back + _CONTACT / 2), "β", size=11, bold=True)
    arrow(axes, pusher, polar(pusher, 112, normal + _DIRECTION), width=2.0)
    arc(axes, pusher, 84, (normal + _DIRECTION, normal))
    note(axes, polar(pusher, 95, normal + _DIRECTION / 2), "α", size=11, bold=True)
    note(axes, (pusher[0] - 12, pusher[1] - 6), "pusher", align="right", size=8)
    _draw_legend(
        axes,
        "β contact angle: from the back of disk 1",
        "α push direction: from the contact normal",
        "both counter-clockwise; here α < 0",
    )


def _draw_legend(axes: Axes, *lines: str) -> None:
    for index, text in enumerate(lines):
        note(axes, (-20, -84 - 15 * index), text, size=8, align="left")


def _draw_frame(axes: Axes) -> None:
    pusher = _draw_disks(axes)
    normal = _AXIS + _CONTACT
    line(axes, pusher, _DISK_1)
    arrow(axes, _DISK_1, polar(_DISK_1, 92, normal), width=1.8)
    arrow(axes, _DISK_1, polar(_DISK_1, 92, normal + 90), width=1.8)
    note(axes, polar(_DISK_1, 103, normal), "x", bold=True, size=10)
    note(axes, polar(_DISK_1, 103, normal + 90), "y", bold=True, size=10)
    axes.plot(*_DISK_1, "o", color=INK, markersize=4)
    table = (-115.0, -105.0)
    arrow(axes, table, (table[0] + 42, table[1]), FAINT)
    arrow(axes, table, (table[0], table[1] + 42), FAINT)
    note(axes, (table[0] + 52, table[1]), "x", color=FAINT, size=8)
    note(axes, (table[0], table[1] + 52), "y", color=FAINT, size=8)
    note(
        axes,
        (table[0] + 8, table[1] - 14),
        "table frame",
        color=FAINT,
        size=8,
        align="left",
    )
    _draw_legend(
        axes,
        "origin: centre of disk 1 at the start",
        "x axis: from the pusher to that centre",
        "fixed during the push",
    )
