"""Overviews: a dot with its interval for each model, in sections, beside the paper."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from statistics import fmean
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.ticker import FixedLocator, PercentFormatter

from sainet.evaluation.claims import our_model
from sainet.evaluation.summary import BASELINE, Summary
from sainet.report.figures import canvas
from sainet.report.figures.curves import METRICS, estimate_of
from sainet.report.palette import INK, ModelStyle, style_of, styles_of

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


class Panel(NamedTuple):
    """Sections beside one axis; every panel of a figure has the same rows."""

    label: str  # of the axis
    sections: Sequence[Section]
    scale: Callable[[Axes], object] = lambda _: None  # sets the axis


def draw_errors_over_physics(parts: Sequence[Part], path: Path) -> Path:
    """Draw each model's position error over that of physics, on a logarithmic axis.

    Errors are means over all disks; a ratio below one is an improvement.

    Args:
        parts: conditions of studies, from top to bottom.
        path: where to write; ``.svg`` or ``.png``.
    """
    sections = [Section(part.title, [*_ratios(part)]) for part in parts]
    label = "position error over that of physics"
    return draw_panels([Panel(label, sections, _set_ratios)], path)


def draw_success(parts: Sequence[Part], path: Path) -> Path:
    """Draw the share of goals that each model solves, with its interval.

    Args:
        parts: conditions of studies with trials, from top to bottom.
        path: where to write; ``.svg`` or ``.png``.
    """
    sections = [Section(part.title, [*_successes(part)]) for part in parts]
    return draw_panels([Panel("goals solved", sections, _set_shares)], path)


def draw_errors(summary: Summary, path: Path) -> Path:
    """Draw each model's errors, disk by disk, with their intervals.

    Args:
        summary: of the measurements, a section for each condition.
        path: where to write; ``.svg`` or ``.png``.
    """
    panels = [
        Panel(
            label,
            [
                Section(each.label, [*_errors(summary, each.label, metric)])
                for each in summary.conditions
            ],
            lambda axes: axes.set_xlim(left=0),
        )
        for metric, label in METRICS.items()
    ]
    return draw_panels(panels, path)


Ranges = dict[str, dict[str, list[float]]]  # by section and row


def draw_ranges(panels: Mapping[str, Ranges], path: Path) -> Path:
    """Draw the mean and the range of the ratios in each row.

    Args:
        panels: ratios by the label of their axis.
        path: where to write; ``.svg`` or ``.png``.
    """
    style, shown = style_of(BASELINE), list[Panel]()
    for label, ranges in panels.items():
        sections = [
            Section(
                title,
                [
                    Dot(replace(style, label=row), fmean(v), min(v), max(v))
                    for row, v in rows.items()
                ],
            )
            for title, rows in ranges.items()
        ]
        shown.append(Panel(label, sections, _set_ratios))
    return draw_panels(shown, path)


def draw_panels(panels: Sequence[Panel], path: Path) -> Path:
    """Draw panels side by side, with the names of their rows on the left.

    Args:
        panels: with the same sections and names.
        path: where to write; ``.svg`` or ``.png``.
    """
    with canvas.house_look():
        rows = sum(len(section.dots) + 1.6 for section in panels[0].sections)
        figure = canvas.new_figure(4 + 3.6 * len(panels), _ENDS + _ROW * rows)
        places = figure.subplots(1, len(panels), sharey=True, squeeze=False)[0]
        for panel, axes in zip(panels, places, strict=True):
            _draw(axes, panel.sections, named=axes is places[0])
            axes.set_xlabel(panel.label)
            panel.scale(axes)
        return canvas.save(figure, path)


def _set_ratios(axes: Axes) -> None:
    """Make an axis one of ratios: logarithmic, with a line at one."""
    axes.set_xscale("log")
    canvas.number_ticks(axes.xaxis, FixedLocator(_SHARES))
    axes.axvline(1, color=INK, linewidth=0.8)
    # An interval may reach far below every number.
    axes.set_xlim(left=max(axes.get_xlim()[0], _SHARES[0] / 2))


def _set_shares(axes: Axes) -> None:
    axes.set_xlim(0, 1.02)
    axes.xaxis.set_major_formatter(PercentFormatter(1))


def _errors(summary: Summary, condition: str, metric: str) -> Iterator[Dot]:
    rows = [row for row in summary.rows if row.condition == condition]
    styles = styles_of((row.model for row in rows), summary.models)
    several = len({row.body for row in rows}) > 1
    for row in rows:
        style, found = styles[row.model], estimate_of(row, metric)
        if several:
            style = replace(style, label=f"{style.label}, disk {row.body}")
        if found.value is not None:
            yield Dot(style, found.value, found.low or 0, found.high or found.value)


def _ratios(part: Part) -> Iterator[Dot]:
    factors = [f for f in part.summary.factors if f.condition == part.condition]
    hidden = {BASELINE, *(each.slug for each in part.summary.models if each.abstains)}
    styles = styles_of((f.model for f in factors), part.summary.models)
    published = _published_ratios(part)
    for each in factors:
        low, high = each.factor.low, each.factor.high
        if each.model not in hidden and low:
            ratio, known = each.error / each.baseline, published.get(each.model)
            yield Dot(styles[each.model], ratio, 1 / (high or np.inf), 1 / low, known)


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


def _draw(axes: Axes, sections: Sequence[Section], *, named: bool) -> None:
    """Draw the sections from top to bottom, and a legend of the published marks."""
    place, names = 0.0, dict[float, str]()
    for section in sections:
        if named:
            at = axes.get_yaxis_transform()
            axes.text(0, place, section.title, transform=at, weight="bold", va="center")
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
