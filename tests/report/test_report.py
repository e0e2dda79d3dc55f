"""The report is one self-contained file with escaped text."""

import json
import re
from dataclasses import replace
from html.parser import HTMLParser
from xml.etree import ElementTree

import numpy as np
import pytest

from report import samples
from sainet.report.figures.curves import draw_learning_curve
from sainet.report.figures.paths import draw_paths
from sainet.report.pages.page import (
    Report,
    inline_svg,
    replay_data,
    to_page,
    write_report,
)
from sainet.report.palette import style_of

HOSTILE = "</script><script>alert(1)</script>&\"'"


@pytest.fixture
def report(tmp_path):
    figures = [
        (draw_paths(samples.replay(), tmp_path / "a.svg"), "Paths of one push."),
        (draw_learning_curve(samples.histories(), tmp_path / "b.png"), "Learning."),
        (draw_paths(samples.replay(), tmp_path / "c.svg").read_text(), "As text."),
    ]
    return Report(
        title="A report",
        summary="First paragraph.\n\nSecond one.",
        table=samples.result(),
        figures=figures,
        replays=[samples.replay(), samples.replay("Another push", ("sain",))],
        manifest={"seed": 0, "versions": {"jax": "0.8.0"}, "git_commit": None},
        commands=["sainet demo --out runs/demo"],
    )


class Page(HTMLParser):
    """Collects the attributes of a page, its identifiers and its scripts."""

    def __init__(self, text):
        super().__init__()
        self.attributes, self.ids, self.scripts, self.inside = [], [], [], False
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.attributes += [(tag, name, value or "") for name, value in attrs]
        self.ids += [value for name, value in attrs if name == "id"]
        self.inside = tag == "script"
        if self.inside:
            self.scripts.append("")

    def handle_endtag(self, tag):
        self.inside = False

    def handle_data(self, data):
        if self.inside:
            self.scripts[-1] += data


def test_a_name_that_is_not_utf_8_does_not_lose_the_page(report, tmp_path):
    """Python reads a byte that is not UTF-8 in a path as half of a surrogate pair."""
    strange = replace(report, commands=["sainet demo --out caf\udce9"])
    text = write_report(strange, tmp_path / "report.html").read_text("utf-8")
    assert "sainet demo --out caf?" in text


def test_one_file_with_everything_in_it(report, tmp_path):
    path = write_report(report, tmp_path / "out" / "report.html")
    text = path.read_text("utf-8")
    assert text.startswith("<!doctype html>")
    for wanted in ("First paragraph.", "sainet demo --out", "0.8.0", "base64,"):
        assert wanted in text
    assert [p.name for p in path.parent.iterdir()] == ["report.html"]


def test_tables_and_legends_show_the_dashes_of_lines(report):
    dash = " ".join(map(str, style_of("in").dash))
    swatches = to_page(report).count(f'stroke-dasharray="{dash}"')
    assert dash and swatches == 2  # of the table, of one replay


def test_no_reference_leaves_the_file(report):
    text = to_page(report)
    outside = re.findall(r"https?://(?!www\.w3\.org/)[^\s\"'<]*", text)
    assert outside == []
    for _, name, value in Page(text).attributes:
        if name in ("src", "href", "xlink:href", "action", "srcset"):
            assert value.startswith(("data:", "#"))
    assert not re.search(r"@import|url\((?!#)", text)


def test_identifiers_are_unique_and_references_resolve(report):
    page = Page(to_page(report))
    assert len(page.ids) == len(set(page.ids))
    text = to_page(report)
    pointed = re.findall(r"url\(#([^)]+)\)|href=\"#([^\"]+)\"", text)
    assert pointed
    assert {first or second for first, second in pointed} <= set(page.ids)
    labels = [value for _, name, value in page.attributes if name == "aria-labelledby"]
    assert set(labels) <= set(page.ids)


def test_the_replay_data_come_through_unchanged(report):
    scripts = Page(to_page(report)).scripts
    assert json.loads(scripts[0]) == replay_data(samples.replay())
    track = json.loads(scripts[0])["tracks"][1]["bodies"][1]
    truth = samples.replay().tracks["physics"]
    assert track["x"] == pytest.approx(1e3 * truth.position[:, 1, 0], abs=6e-4)
    assert track["angle"] == pytest.approx(truth.angle[:, 1], abs=6e-6)


def test_hostile_text_is_escaped_everywhere():
    result = samples.summary([samples.row(HOSTILE, 1, 1.0, group=HOSTILE)])
    report = Report(
        title=HOSTILE,
        subtitle=HOSTILE,
        summary=HOSTILE,
        table=result,
        figures=[("<svg></svg>", HOSTILE)],
        replays=[samples.replay(HOSTILE, (HOSTILE,))],
        manifest={HOSTILE: HOSTILE},
        commands=[HOSTILE],
    )
    text = to_page(report)
    assert "<script>alert" not in text
    scripts = Page(text).scripts
    assert len(scripts) == 2  # the data of the replay and the player
    assert json.loads(scripts[0])["title"] == HOSTILE


def test_nan_becomes_null():
    push = samples.replay()
    push.tracks["in"].position[3] = np.nan
    data = json.loads(json.dumps(replay_data(push), allow_nan=False))
    assert data["tracks"][3]["bodies"][0]["x"][2:4][1] is None


def test_a_report_may_be_nearly_empty(tmp_path):
    path = write_report(Report(title="Nothing yet"), tmp_path / "report.html")
    text = path.read_text()
    assert "<script" not in text
    assert "How this was made" in text


def player(model, pushes, solved=True):
    return samples.record(model=model, pushes=pushes, solved=solved)


@pytest.mark.parametrize(
    ("players", "sentence"),
    [
        (
            [player("sain", 2), player("physics", 2)],
            "SAIN and Physics each reach it with 2 pushes, so this goal does not "
            "distinguish them.",
        ),
        (
            [player("physics", 3), player("sain", 1)],
            "SAIN reaches it with 1 push, Physics with 3 pushes.",
        ),
        (
            [player("sain", 2), player("physics", 3, solved=False)],
            "SAIN reaches it with 2 pushes; Physics does not.",
        ),
        (
            [player(model, 3, solved=False) for model in ("sain", "in", "physics")],
            "SAIN, IN and Physics do not reach it.",
        ),
    ],
)
def test_players_of_one_goal_are_compared(players, sentence):
    other = samples.record(goals="hard")
    page = to_page(Report(title="A report", episodes=[*players, other]))
    assert re.findall("<p>(Easy goal 1: .*|Hard goal 1: .*)</p>", page) == [
        f"Easy goal 1: {sentence}"
    ]
    # A row for each goal, each closed.
    assert page.count('<div class="abreast">') == 2
    assert page.count("<div") == page.count("</div>")


def test_a_figure_on_a_page_has_an_svg_for_each_panel(tmp_path):
    drawn = draw_paths(samples.replay(), tmp_path / "a.svg").read_text()
    page = inline_svg(drawn, 1)
    panels = page.split("</svg>")[:-1]
    assert len(panels) == 3
    titles = ("The push", "Centre of disk 1", "Centre of disk 2")
    for panel, title in zip(panels, titles, strict=True):
        ElementTree.fromstring(f"{panel}</svg>")  # each is complete
        assert re.findall(">((?:The|Centre)[^<]*)<", panel) == [title]
    said = re.compile("<text.*?>([^<]*)</text>", re.DOTALL)
    assert said.findall(page) == said.findall(drawn)
