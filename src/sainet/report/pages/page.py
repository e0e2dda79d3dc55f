"""The report: one self-contained HTML file."""

import base64
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from markupsafe import Markup

from sainet.evaluation.summary import Summary
from sainet.report.arrange import arrange
from sainet.report.episode_frames import episode_data
from sainet.report.pages.svg import inline_svg, read_svg
from sainet.report.pages.templates import read, render
from sainet.report.palette import css_variables, styles_of
from sainet.report.replay import Replay, Track
from sainet.report.writers import to_html
from sainet.runs.documents import write_bytes

REPORT = "report.html"
_SCRIPTS = ("motion.js", "draw.js", "transport.js", "replay.js", "episode.js")
_DECIMALS_MM = 3
_DECIMALS_RAD = 5


@dataclass(frozen=True, kw_only=True)
class Report:
    """Contents of a report. Every string except the SVG of figures is escaped."""

    title: str
    subtitle: str = ""
    summary: str = ""  # plain text, paragraphs parted by empty lines
    table: Summary | None = None
    # Files (.svg, .png) or SVG text that the package itself drew, with captions.
    figures: Sequence[tuple[Path | str, str]] = ()
    replays: Sequence[Replay] = ()
    episodes: Sequence[Mapping[str, Any]] = ()  # records of `sainet control`
    manifest: Mapping[str, Any] = field(default_factory=dict)
    commands: Sequence[str] = ()


def write_report(report: Report, path: Path) -> Path:
    """Write the report atomically and return its path."""
    write_bytes(path, to_page(report).encode())
    return path


def to_page(report: Report) -> str:
    """Return the report as one HTML page without external references."""
    return render(
        "report.html.j2",
        report=report,
        paragraphs=[text for text in re.split(r"\n\s*\n", report.summary) if text],
        replays=[replay_data(replay) for replay in report.replays],
        episodes=[episode_data(record) for record in report.episodes],
        table=Markup(to_html(arrange(report.table))) if report.table else "",
        is_of_trials=report.table is not None and report.table.is_of_trials,
        figures=list(_pictures(report.figures)),
        manifest=list(_flatten(report.manifest)),
        light=css_variables(dark=False),
        dark=css_variables(dark=True),
        css=Markup(read("report.css")),
        script=Markup('"use strict";\n' + "\n".join(map(read, _SCRIPTS))),
    )


def replay_data(replay: Replay) -> dict[str, Any]:
    """Return a replay as JSON values for the script of the page (mm, rad, s)."""
    styles = styles_of(replay.tracks)
    reference = replay.reference
    return {
        "title": replay.title,
        "timeStep": replay.time_step,
        "steps": len(reference.angle) - 1,
        "radius": [1e3 * radius for radius in replay.radius],
        "pusherRadius": 1e3 * replay.pusher_radius,
        "pusher": _plane(reference.pusher),
        "tracks": [
            {
                "label": styles[name].label,
                "color": styles[name].variable,
                "dash": list(styles[name].dash),
                "isTruth": track is reference,
                "bodies": _bodies(track),
            }
            for name, track in replay.tracks.items()
        ],
    }


def _bodies(track: Track) -> list[dict[str, list[float | None]]]:
    return [
        _plane(track.position[:, body])
        | {"angle": _numbers(track.angle[:, body], _DECIMALS_RAD)}
        for body in range(track.angle.shape[1])
    ]


def _plane(position: np.ndarray) -> dict[str, list[float | None]]:
    x, y = 1e3 * np.asarray(position, float).T
    return {"x": _numbers(x, _DECIMALS_MM), "y": _numbers(y, _DECIMALS_MM)}


def _numbers(values: np.ndarray, decimals: int) -> list[float | None]:
    """Return rounded numbers, with None for NaN and infinity, which JSON lacks."""
    rounded = np.round(np.asarray(values, float), decimals)
    return [value if np.isfinite(value) else None for value in rounded.tolist()]


def _pictures(
    figures: Sequence[tuple[Path | str, str]],
) -> Iterator[dict[str, str]]:
    for number, (source, caption) in enumerate(figures, start=1):
        if isinstance(source, str):
            picture = inline_svg(source, number)
        elif source.suffix.lower() == ".svg":
            picture = inline_svg(read_svg(source), number)
        else:
            data = base64.b64encode(source.read_bytes()).decode()
            picture = Markup('<img alt="" src="data:image/png;base64,{}">').format(data)
        yield {"picture": picture, "caption": caption}


def _flatten(values: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, str]]:
    for name, value in values.items():
        if isinstance(value, Mapping):
            yield from _flatten(value, f"{prefix}{name} · ")
        elif value is not None:
            yield f"{prefix}{name}".replace("_", " "), str(value)
