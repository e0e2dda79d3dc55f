"""The report: one self-contained HTML file."""

import base64
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
from markupsafe import Markup

from sainet.control.record import EpisodeRecord
from sainet.evaluation.summary import Summary
from sainet.report.arrange import arrange
from sainet.report.episode_frames import Replay, Track, episode_data, numbers, plane
from sainet.report.pages import read, render
from sainet.report.palette import css_variables, styles_of
from sainet.report.table import Table
from sainet.report.writers import to_html
from sainet.runs.documents import read_file, write_bytes
from sainet.runs.errors import BadInput

REPORT = "report.html"
_SCRIPTS = ("motion.js", "draw.js", "transport.js", "replay.js", "episode.js")
_CONCLUSIONS = 1  # sentences at the top
_DECIMALS_MM = 3
_DECIMALS_RAD = 5
_SPEEDS = (0.1, 0.25, 1)  # that a reader chooses from, slow ones first
_LONGEST = 10  # seconds that a push plays, at such a speed
# Elements and attributes of figures drawn by this package.
_SHAPES = ("svg", "defs", "style", "g", "path", "use", "text", "clipPath", "rect")
_ATTRIBUTES = {
    *("id", "style", "type", "version", "viewBox", "width", "height", "x", "y", "d"),
    *("transform", "clip-path", "href"),
}
# CSS that loads external content, and escapes that could hide it.
_REFERS_OUTSIDE = re.compile(r"url\(\s*(?!#)|@|\\", re.IGNORECASE)
_PANEL = re.compile(r'<g id="panel-([\d.]+)-([\d.]+)">')
_WIDTH = re.compile(r'(<svg[^>]*?) width="[\d.]+pt"([^>]*?) viewBox="0 0 [\d.]+ ')
_NAMESPACES = {
    "": "http://www.w3.org/2000/svg",
    "xlink": "http://www.w3.org/1999/xlink",
}


@dataclass(frozen=True, kw_only=True)
class PlainTable:
    """Table of texts; the first cell of a row names it."""

    title: str
    note: str = ""
    columns: Sequence[str]
    rows: Sequence[Sequence[str]]


@dataclass(frozen=True, kw_only=True)
class Part:
    """One of several studies in a report."""

    name: str  # also of its link
    question: str
    table: Summary
    sentences: Sequence[str] = ()
    figures: Sequence[tuple[Path | str, str]] = ()


@dataclass(frozen=True, kw_only=True)
class Report:
    """Contents of a report. Every string except the SVG of figures is escaped."""

    title: str
    subtitle: str = ""
    summary: str = ""  # plain text, paragraphs parted by empty lines
    conclusion: str = ""  # at the top; empty: the first verdict on the table
    table: Summary | None = None
    # Files (.svg, .png) or SVG text that the package itself drew, with captions.
    figures: Sequence[tuple[Path | str, str]] = ()
    plain_tables: Sequence[PlainTable] = ()
    parts: Sequence[Part] = ()
    replays: Sequence[Replay] = ()
    episodes: Sequence[EpisodeRecord] = ()
    manifest: Mapping[str, object] = field(default_factory=dict)
    commands: Sequence[str] = ()


def write_report(report: Report, path: Path) -> Path:
    """Write the report atomically and return its path."""
    write_bytes(path, to_page(report).encode(errors="replace"))
    return path


def to_page(report: Report) -> str:
    """Return the report as one HTML page without external references."""
    table = arrange(report.table) if report.table else None
    return render(
        "report.html.j2",
        report=report,
        paragraphs=[text for text in re.split(r"\n\s*\n", report.summary) if text],
        replays=[replay_data(replay) for replay in report.replays],
        has_regions=any(replay.has_regions for replay in report.replays),
        episodes=[episode_data(record) for record in report.episodes],
        conclusions=_conclusions(report, table),
        table=Markup(to_html(table)) if table else "",
        is_of_trials=report.table is not None and report.table.is_of_trials,
        figures=list(_pictures(report.figures)),
        parts=list(_parts(report)),
        manifest=list(_flatten(report.manifest)),
        light=css_variables(dark=False),
        dark=css_variables(dark=True),
        css=Markup(read("report.css")),
        script=Markup('"use strict";\n' + "\n".join(map(read, _SCRIPTS))),
    )


def _parts(report: Report) -> Iterator[dict[str, object]]:
    """Yield what the page shows of each part; figures are counted through."""
    count = 1 + len(report.figures)
    for part in report.parts:
        yield {
            "name": part.name,
            "question": part.question,
            "sentences": part.sentences,
            "figures": list(_pictures(part.figures, count)),
            "table": Markup(to_html(arrange(part.table))),
        }
        count += len(part.figures)


def _conclusions(report: Report, table: Table | None) -> Sequence[str]:
    if report.conclusion:
        return (report.conclusion,)
    return table.verdicts[:_CONCLUSIONS] if table else ()


def replay_data(replay: Replay) -> dict[str, object]:
    """Return a replay as JSON values for the script of the page (mm, rad, s)."""
    styles = styles_of(replay.tracks, replay.models)
    reference = replay.reference
    return {
        "title": replay.title,
        "timeStep": replay.time_step,
        "steps": len(reference.angle) - 1,
        "speed": _speed(replay.time_step * (len(reference.angle) - 1)),
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
                "region": _region(track),
            }
            for name, track in replay.tracks.items()
        ],
    }


def _speed(duration: float) -> float:
    """Return how fast a push of some length (s) plays at first."""
    return next((s for s in _SPEEDS[:-1] if duration / s <= _LONGEST), _SPEEDS[-1])


def _bodies(track: Track) -> list[dict[str, list[float | None]]]:
    angle = np.asarray(track.angle, float).round(_DECIMALS_RAD)
    return [
        _plane(track.position[:, body]) | {"angle": numbers(angle[:, body])}
        for body in range(angle.shape[1])
    ]


def _region(track: Track) -> dict[str, object] | None:
    """Return the region of the end as JSON values: rad, mm, and degrees."""
    region = track.region
    if region is None:
        return None
    return {
        "heading": round(region.heading, _DECIMALS_RAD),
        "axes": (1e3 * np.asarray(region.axes, float)).round(_DECIMALS_MM).tolist(),
        "turn": np.degrees(region.turn, dtype=float).round(1).tolist(),
    }


def _plane(position: np.ndarray) -> dict[str, list[float | None]]:
    return plane((1e3 * np.asarray(position, float)).round(_DECIMALS_MM))


def _pictures(
    figures: Sequence[tuple[Path | str, str]], first: int = 1
) -> Iterator[dict[str, object]]:
    for number, (source, caption) in enumerate(figures, start=first):
        if isinstance(source, str):
            picture = inline_svg(source, number)
        elif source.suffix.lower() == ".svg":
            picture = inline_svg(read_svg(source), number)
        else:
            data = base64.b64encode(source.read_bytes()).decode()
            picture = Markup('<img alt="" src="data:image/png;base64,{}">').format(data)
        yield {"number": number, "picture": picture, "caption": caption}


def read_svg(path: Path) -> str:
    """Return a checked figure that this package drew.

    The result is rebuilt from its checked parts, without comments and declarations,
    which could hide other content.

    Raises:
        BadInput: the file contains anything else, which might act in the page.
    """
    try:
        figure = ElementTree.fromstring(read_file(path).decode())
    except (OSError, ValueError, ElementTree.ParseError) as error:
        raise BadInput(f"{path}: cannot be read as a figure ({error}).") from None
    for about in figure.findall(f"{{{_NAMESPACES['']}}}metadata"):
        figure.remove(about)
    for part in figure.iter():
        name = part.tag.rpartition("}")[2]
        rules = part.text or "" if name == "style" else ""
        plain = all(map(_is_plain, part.attrib.items()))
        if name not in _SHAPES or not plain or _REFERS_OUTSIDE.search(rules):
            raise BadInput(
                f"{path}: <{name}> does not occur in figures of sainet; delete or move "
                "the file."
            )
    for prefix, name in _NAMESPACES.items():
        ElementTree.register_namespace(prefix, name)
    return ElementTree.tostring(figure, "unicode")


def _is_plain(attribute: tuple[str, str]) -> bool:
    """Return whether an attribute has no action and no external reference."""
    name, value = attribute[0].rpartition("}")[2], attribute[1]
    if name not in _ATTRIBUTES or (name == "href" and not value.startswith("#")):
        return False
    return not _REFERS_OUTSIDE.search(value)


def inline_svg(text: str, number: int) -> Markup:
    """Return an SVG as part of a page.

    Identifiers get a prefix, so that they are unique among figures. The colours of
    the palette become variables, which follow the theme of the page.
    """
    svg = text[text.index("<svg") :]
    svg = re.sub(r"<metadata>.*?</metadata>|<!--.*?-->", "", svg, flags=re.DOTALL)
    svg = _in_panels(svg)
    svg = re.sub(r'\bid="', f'id="figure-{number}-', svg)
    svg = re.sub(r'(href="#|url\(#)', rf"\1figure-{number}-", svg)
    variables = css_variables(dark=False)
    for name, color in sorted(variables.items(), reverse=True):
        svg = svg.replace(color, f"var({name})")
    return Markup(svg)


def _in_panels(svg: str) -> str:
    """Return a figure with an SVG for each named panel, for pages of any width."""
    head, *parts = _PANEL.split(svg)
    # Without the background, which would cover a neighbour.
    head = head.partition('<g id="figure_1">')[0] + "<g><g>"
    panels = [
        _WIDTH.sub(rf'\1 width="{wide}pt"\2 viewBox="{left} 0 {wide} ', head) + panel
        for left, wide, panel in zip(parts[::3], parts[1::3], parts[2::3], strict=True)
    ]
    return "</g></svg>".join(panels) or svg


def _flatten(
    values: Mapping[str, object], prefix: str = ""
) -> Iterator[tuple[str, str]]:
    for name, value in values.items():
        if isinstance(value, Mapping):
            yield from _flatten(value, f"{prefix}{name} · ")
        elif value is not None:
            yield f"{prefix}{name}".replace("_", " "), str(value)
