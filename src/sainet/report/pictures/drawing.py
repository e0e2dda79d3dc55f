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
    axes.add_patch(
        Circle(
            centre,
            radius,
            facecolor="none" if ghost else color,
            edgecolor=color,
            alpha=1.0 if ghost else 0.32,
            linewidth=1.2,
        )
    )
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
    axes.add_patch(
        FancyArrowPatch(
            start,
            end,
            arrowstyle="-|>",
            mutation_scale=11,
            shrinkA=0,
            shrinkB=0,
            color=color,
            linewidth=width,
            linestyle="--" if dashed else "-",
        )
    )


def line(axes: Axes, start: Point, end: Point, color: str = FAINT) -> None:
    """Draw a thin dashed line."""
    axes.plot(*zip(start, end, strict=True), color=color, linewidth=0.9, dashes=(4, 3))


def arc(
    axes: Axes, centre: Point, radius: float, degrees: Point, color: str = INK
) -> None:
    """Draw an arc between two angles, counter-clockwise."""
    size = 2 * radius
    axes.add_patch(
        Arc(
            centre,
            size,
            size,
            theta1=degrees[0],
            theta2=degrees[1],
            color=color,
            linewidth=1.3,
        )
    )


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
    axes.text(
        *place,
        text,
        color=color,
        fontsize=size,
        ha=align,
        va="center",
        fontweight="bold" if bold else "normal",
    )


def box(axes: Axes, corner: Point, size: Point, color: str) -> None:
    """Draw a rounded box with a coloured edge."""
    axes.add_patch(
        FancyBboxPatch(
            corner,
            *size,
            boxstyle="round,pad=0,rounding_size=0.12",
            facecolor=color + "1c",
            edgecolor=color,
            linewidth=1.3,
        )
    )


def polar(centre: Point, radius: float, degrees: float) -> Point:
    """Return the point at a distance and an angle from a centre."""
    angle = np.deg2rad(degrees)
    return (
        float(centre[0] + radius * np.cos(angle)),
        float(centre[1] + radius * np.sin(angle)),
    )
