"""The same numbers in a terminal, in Markdown and in HTML, and no markup from names."""

import io
import re
from html.parser import HTMLParser

import pytest
from rich.console import Console

from report import samples
from sainet.report.tables import print_table, to_html, to_markdown

HOSTILE = "<script>alert(1)</script>|[red]*x*"


def printed(result, width=120):
    stream = io.StringIO()
    print_table(result, Console(file=stream, width=width, color_system=None))
    return stream.getvalue()


class Cells(HTMLParser):
    """Collects the text of each table cell, row by row."""

    def __init__(self):
        super().__init__()
        self.rows, self.inside, self.tags = [], False, set()

    def handle_starttag(self, tag, _):
        self.tags.add(tag)
        if tag == "tr":
            self.rows.append([])
        if tag in ("td", "th"):
            self.rows[-1].append("")
        if tag == "small":
            self.rows[-1][-1] += " "
        self.inside = tag != "p"

    def handle_data(self, data):
        if self.inside and self.rows and self.rows[-1]:
            self.rows[-1][-1] += data.strip()


def parse(result):
    cells = Cells()
    cells.feed(to_html(result))
    return cells


def test_html_has_every_number_in_its_cell():
    row = parse(samples.result()).rows[2]
    assert row[:4] == ["Physics", "500", "1.44 1.35–1.54", "1.30 1.22–1.39"]
    assert row[-2:] == ["34.0 32.0–36.4", "30.6 28.8–32.7"]


def test_markdown_rows_all_have_the_same_columns():
    text = to_markdown(samples.result())
    rows = [line for line in text.splitlines() if line.startswith("|")]
    assert {len(re.split(r"(?<!\\)\|", row)) for row in rows} == {10}
    assert "| 3.60 / 3.24<br><sub>3.38–3.85 / 3.05–3.47</sub> |" in rows[2]
    assert "**0.59** / **0.53**" in rows[5]
    assert rows[6].startswith("| *Physics, published* |")
    assert "*6.27* / *5.81*" in rows[6]
    assert "SAIN minus IN: pos −0.162" in text


def test_terminal_shows_columns_by_disk_or_pairs_when_narrow():
    wide, narrow = (printed(samples.result(), width) for width in (120, 80))
    assert "3.38–3.85" in wide
    assert re.search(r"Physics +500 .* 3\.60 +3\.24", wide)
    assert "3.38–3.85" not in narrow
    assert re.search(r"Physics +500 .* 3\.60/3\.24", narrow)
    assert max(map(len, narrow.splitlines())) <= 80
    assert "…" not in narrow


def test_the_best_of_each_group_is_marked():
    rows = [
        samples.row(model, 1, scale, group)
        for group, scales in (("abs-10", (1.0, 0.5)), ("plywood-10", (0.4, 0.8)))
        for model, scale in zip(("physics", "sain"), scales, strict=True)
    ]
    lines = to_markdown({"rows": rows, "published": []}).splitlines()
    assert [("**" in line) for line in lines[2:6]] == [False, True, True, False]
    assert lines[2].startswith("| abs-10 | Physics |")


@pytest.mark.parametrize("missing", [None, float("nan"), float("inf"), "n/a"])
def test_a_missing_number_is_a_dash(missing):
    result = samples.result()
    result["rows"][0] |= {"pos_mm": missing, "pos_mm_interval": None}
    assert parse(result).rows[2][4] == "–"
    assert "| – / 3.24" in to_markdown(result)
    assert "nan" not in printed(result)


def test_metrics_without_numbers_are_left_out():
    rows = [{"model": "physics", "body": 1, "group": None, "n": 9, "final_pos_mm": 2.8}]
    result = {"rows": rows, "published": []}
    assert to_markdown(result).splitlines()[0] == "| Model | n | final pos (mm) |"
    assert "trans" not in printed(result)


def test_final_errors_are_not_repeated():
    rows = [samples.row(model, 1, 0.5) for model in ("physics", "sain")]
    for row in rows:
        row |= {"pos_mm": row["final_pos_mm"], "rot_deg": row["final_rot_deg"]}
    pair = {"model": "sain", "against": "physics", "group": None, "body": 1}
    told = [
        pair | {"metric": metric, "difference": -1.0, "interval": [-2.0, -0.5]}
        for metric in ("pos_mm", "final_pos_mm")
    ]
    result = {"rows": rows, "comparisons": told}
    heading = to_markdown(result).splitlines()[0]
    assert heading.split(" | ")[2:4] == ["final pos (mm)", "final rot (deg)"]
    assert "trans" not in printed(result)
    assert printed(result).count("−1.000") == 1
    alone = {"rows": rows, "comparisons": told[1:]}  # of ends alone: still said
    assert printed(alone).count("−1.000") == 1


def test_physics_is_the_reference_without_true_properties():
    told = [
        {"model": "sain", "against": against, "group": None, "body": 1}
        | {"metric": "pos_mm", "difference": -1.0, "interval": None}
        for against in ("physics", "physics-true", "in")
    ]
    rows = {name: samples.row(name, 1, 0.5) for name in ("physics", "in", "sain")}
    without = printed({"rows": [*rows.values()], "comparisons": [told[0], told[2]]})
    assert "SAIN minus Physics: pos" in without
    rows["physics-true"] = samples.row("physics-true", 1, 0.5)
    beside = printed({"rows": [*rows.values()], "comparisons": told})
    assert "SAIN minus Physics, true properties: pos" in beside
    assert "SAIN minus Physics: pos" not in beside


def test_an_empty_table_is_a_sentence():
    for text in (to_html({"rows": []}), to_markdown({"rows": []}), printed({})):
        assert "Nothing to show" in text


def test_hostile_names_stay_text():
    result = samples.result()
    result["rows"] += [samples.row(HOSTILE, 1, 0.3, group=HOSTILE)]
    cells = parse(result)
    assert "script" not in cells.tags
    assert "alert(1)" in str(cells.rows)
    markdown = to_markdown(result)
    assert "<script" not in markdown
    rows = [line for line in markdown.splitlines() if line.startswith("|")]
    assert len({len(re.split(r"(?<!\\)\|", row)) for row in rows}) == 1
    assert "[red]" in printed(result, 200)
