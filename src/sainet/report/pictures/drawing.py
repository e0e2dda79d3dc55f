"""Shapes of the explaining pictures: disks, arrows, arcs, boxes and notes."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Arc, Circle, FancyArrowPatch, FancyBboxPatch

from sainet.report.figures.canvas import new_figure
from sainet.report.palette import INK

Point = tuple[float, float]
FAINT = "#8b8f94"
GROUND = "#f4f2ee"


def bare_axes(
    width: float, height: float, across: Point, up: Point
) -> tuple[Figure, Axes]:
    """Return a figure (inches) with one frameless axes of equal scales."""
    figure = new_figure(width, height)
    axes = figure.subplots()
    prepare(axes, across, up)
    return figure, axes


def prepare(axes: Axes, across: Point, up: Point) -> None:
    """Make axes frameless, with equal scales and these limits."""
    axes.set_axis_off()
    axes.set_aspect("equal")
    axes.set_xlim(*across)
    axes.set_ylim(*up)


def disk(
    axes: Axes, centre: Point, radius: float, color: str, *, ghost: bool = False
) -> None:
    """Draw a disk; a ghost is an outline."""
    face, alpha = ("none", 1.0) if ghost else (color, 0.32)
    axes.add_patch(Circle(centre, radius, fc=face, ec=color, alpha=alpha, lw=1.2))
    if not ghost:
        axes.add_patch(Circle(centre, radius, fill=False, edgecolor=color, lw=1.4))


def arrow(
    axes: Axes,
    start: Point,
    end: Point,
    color: str = INK,
    *,
    width: float = 1.4,
    dashed: bool = False,
) -> None:
    """Draw an arrow from a point to a point."""
    shape = FancyArrowPatch(
        start, end, arrowstyle="-|>", mutation_scale=11, shrinkA=0, shrinkB=0
    )
    shape.set(color=color, linewidth=width, linestyle="--" if dashed else "-")
    axes.add_patch(shape)


def line(axes: Axes, start: Point, end: Point, color: str = FAINT) -> None:
    """Draw a thin dashed line."""
    axes.plot(*zip(start, end, strict=True), color=color, linewidth=0.9, dashes=(4, 3))


def arc(
    axes: Axes, centre: Point, radius: float, degrees: Point, color: str = INK
) -> None:
    """Draw an arc between two angles, counter-clockwise."""
    size, (first, last) = 2 * radius, degrees
    shape = Arc(centre, size, size, theta1=first, theta2=last, color=color, lw=1.3)
    axes.add_patch(shape)


def note(
    axes: Axes,
    place: Point,
    text: str,
    *,
    color: str = INK,
    size: float = 9,
    align: str = "center",
    bold: bool = False,
) -> None:
    """Write a short text at a point."""
    weight = "bold" if bold else "normal"
    axes.text(
        *place, text, color=color, size=size, weight=weight, ha=align, va="center"
    )


def box(axes: Axes, corner: Point, size: Point, color: str) -> None:
    """Draw a rounded box with a coloured edge."""
    shape = FancyBboxPatch(corner, *size, boxstyle="round,pad=0,rounding_size=0.12")
    shape.set(facecolor=color + "1c", edgecolor=color, linewidth=1.3)
    axes.add_patch(shape)


def polar(centre: Point, radius: float, degrees: float) -> Point:
    """Return the point at a distance and an angle from a centre."""
    angle = np.deg2rad(degrees)
    return (
        float(centre[0] + radius * np.cos(angle)),
        float(centre[1] + radius * np.sin(angle)),
    )
