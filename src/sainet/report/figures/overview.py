"""Overviews: a dot with its interval for each model, in sections, beside the paper."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.ticker import (
    FixedLocator,
    FuncFormatter,
    NullFormatter,
    PercentFormatter,
)

from sainet.evaluation.claims import our_model
from sainet.evaluation.summary import BASELINE, Summary
from sainet.report.figures import canvas
from sainet.report.palette import INK, ModelStyle, styles_of

_METRIC = "pos_mm"
_SHARES = (0.1, 0.15, 0.2, 0.3, 0.5, 0.7, 1.0, 1.5, 2, 3, 5, 7, 10, 20)
_ROW, _ENDS = 0.19, 0.9  # inches: of a row, and above and below all rows


class Dot(NamedTuple):
    """A model's number, its interval and the published number."""

    style: ModelStyle
    value: float
    low: float
    high: float
    published: float | None = None


class Section(NamedTuple):
    """Dots below one title."""

    title: str
    dots: Sequence[Dot]


class Part(NamedTuple):
    """A condition of a study."""

    title: str
    summary: Summary
    condition: str = ""


def draw_errors_over_physics(parts: Sequence[Part], path: Path) -> Path:
    """Draw each model's position error over that of physics, on a logarithmic axis.

    Errors are means over all disks; a ratio below one is an improvement.

    Args:
        parts: conditions of studies, from top to bottom.
        path: where to write; ``.svg`` or ``.png``.
    """
    sections = [Section(part.title, [*_ratios(part)]) for part in parts]
    with canvas.house_look():
        figure = canvas.new_figure(7.6, _height(sections))
        axes = figure.subplots()
        axes.set(xscale="log", xlabel="position error over that of physics")
        axes.xaxis.set_major_locator(FixedLocator(_SHARES))
        axes.xaxis.set_major_formatter(FuncFormatter(lambda x, _: f"{x:g}"))
        axes.xaxis.set_minor_formatter(NullFormatter())
        axes.axvline(1, color=INK, linewidth=0.8)
        _draw(axes, sections)
        # An interval may reach far below every number.
        axes.set_xlim(left=max(axes.get_xlim()[0], _SHARES[0] / 2))
        return canvas.save(figure, path)


def draw_success(parts: Sequence[Part], path: Path) -> Path:
    """Draw the share of goals that each model solves, with Wilson's interval.

    Args:
        parts: conditions of studies with trials, from top to bottom.
        path: where to write; ``.svg`` or ``.png``.
    """
    sections = [Section(part.title, [*_successes(part)]) for part in parts]
    with canvas.house_look():
        figure = canvas.new_figure(7.6, _height(sections))
        axes = figure.subplots()
        axes.set(xlim=(0, 1.02), xlabel="goals solved")
        axes.xaxis.set_major_formatter(PercentFormatter(1))
        _draw(axes, sections)
        return canvas.save(figure, path)


def _ratios(part: Part) -> Iterator[Dot]:
    factors = [f for f in part.summary.factors if f.condition == part.condition]
    hidden = {BASELINE, *(each.slug for each in part.summary.models if each.abstains)}
    styles = styles_of((f.model for f in factors), part.summary.models)
    published = _published_ratios(part)
    for each in factors:
        low, high = each.factor.low, each.factor.high
        if each.model not in hidden and low and high:
            ratio = each.error / each.baseline
            known = published.get(each.model)
            yield Dot(styles[each.model], ratio, 1 / high, 1 / low, known)


def _published_ratios(part: Part) -> dict[str, float]:
    """Return the published errors over those of physics, by our models."""
    found = {
        our_model(each.model, part.summary): float(
            np.sum(np.array(each.values[_METRIC], float))
        )
        for each in part.summary.published
        if each.condition == part.condition and _METRIC in each.values
    }
    baseline = found.pop(BASELINE, None)
    return {model: error / baseline for model, error in found.items() if baseline}


def _successes(part: Part) -> Iterator[Dot]:
    rows = [row for row in part.summary.trials if row.condition == part.condition]
    styles = styles_of((row.model for row in rows), part.summary.models)
    published: Mapping[str, float | None] = {
        each.model.slug: each.values["success"][0]
        for each in part.summary.published
        if each.condition == part.condition
    }
    for row in rows:
        known = published.get(row.model)
        yield Dot(styles[row.model], row.success, *row.interval, known)


def _height(sections: Sequence[Section]) -> float:
    return _ENDS + _ROW * sum(len(section.dots) + 1.6 for section in sections)


def _draw(axes: Axes, sections: Sequence[Section]) -> None:
    """Draw the sections from top to bottom, and a legend of the published marks."""
    place, names = 0.0, dict[float, str]()
    for section in sections:
        title = axes.get_yaxis_transform()
        axes.text(0, place, section.title, transform=title, weight="bold", va="center")
        for dot in section.dots:
            place += 1
            names[place] = dot.style.label
            _draw_dot(axes, dot, place)
        place += 1.6
    axes.set_yticks([*names], labels=[*names.values()])
    axes.tick_params(axis="y", length=0)
    axes.set_ylim(place - 0.9, -0.8)
    axes.spines["left"].set_visible(False)
    canvas.add_grid(axes, "x")
    if any(dot.published is not None for section in sections for dot in section.dots):
        mark = Line2D([], [], label="published", **_published(INK))
        # Above the rows: below them are dots.
        axes.legend(handles=[mark], loc="lower right", bbox_to_anchor=(1, 1))


def _published(color: str) -> canvas.LineLook:
    """Return the look of a published number: a hollow diamond."""
    look = canvas.LineLook(color=color, linewidth=0, marker="D", markersize=5.5)
    return look | canvas.LineLook(markerfacecolor="none")


def _draw_dot(axes: Axes, dot: Dot, place: float) -> None:
    color = dot.style.color
    axes.plot([dot.low, dot.high], [place, place], color=color, linewidth=2, alpha=0.45)
    axes.plot(dot.value, place, "o", color=color, markersize=5)
    if dot.published is not None:
        axes.plot(dot.published, place, **_published(color))
