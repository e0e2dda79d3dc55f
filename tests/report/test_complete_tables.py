"""Complete tables of the site: every number of the results, and they sort."""

import csv
import io
import re

import pytest

from report import samples
from report.test_report_browser import opened
from sainet.studies.evidence import RESULTS
from support import REPOSITORY, require


@pytest.fixture
def tables(monkeypatch):
    """The generator of the tables."""
    require((REPOSITORY / RESULTS).is_dir(), "this copy has no results")
    monkeypatch.syspath_prepend(REPOSITORY / "docs")
    import site_pages.tables

    return site_pages.tables


def test_a_csv_has_every_estimate_in_three_columns(tables):
    summary = samples.result()
    errors, compared = tables.grids("sample", summary)
    rows = list(csv.DictReader(io.StringIO(errors.to_csv())))
    assert len(rows) == len(summary.rows) // 2 + len(summary.published)
    for row in summary.rows:
        known = next(
            r for r in rows if r["model"] == tables.labels_of(summary.models)[row.model]
        )
        estimate = row.values["pos_mm"]
        found = [known[f"pos (mm), disk {row.body}{e}"] for e in ("", " low", " high")]
        wanted = estimate.value, estimate.low, estimate.high
        assert list(map(float, found)) == pytest.approx(wanted, rel=1e-5)
    (row,) = csv.DictReader(io.StringIO(compared.to_csv()))
    assert float(row["difference"]) == summary.comparisons[0].difference.value
    assert "from" in errors.to_csv() and "pushes," not in compared.to_csv()


def test_names_are_text_in_a_table(tables):
    grid = tables.Grid("", "<b>", [tables.Column("a & b")], [["<script>"], [None]])
    text = grid.to_html()
    assert "<script>" not in text and "<b>" not in text and "a &amp; b" in text
    assert grid.to_csv() == 'a & b\n<script>\n""\n'


def test_every_table_that_a_page_names_has_evidence(tables):
    names = tables.named_tables(REPOSITORY / "docs")
    kept = {path.name.split(".")[0] for path in (REPOSITORY / RESULTS).iterdir()}
    assert names.keys() <= kept
    measured = {
        path.name.split(".")[0] for path in (REPOSITORY / RESULTS).glob("*.nc.*")
    }
    assert measured <= names.keys()


@pytest.mark.browser
def test_a_table_sorts_by_keys_alone_and_a_word_selects_rows(
    tables, chromium, tmp_path
):
    values = [[3.0, "c"], [None, "b"], [-10.0, "a"], [0.25, "d"]]
    grid = tables.Grid("", "T", [tables.Column("x"), tables.Column("y")], values)
    script = (REPOSITORY / "docs/site_pages/static/sort.js").read_text()
    page = f"{grid.to_html()}<input class=filter><script>{script}</script>"
    (tmp_path / "report.html").write_text(f"<meta charset=utf-8>{page}")
    with opened(chromium, tmp_path) as driver:

        def order():
            rows = driver.find_elements("css selector", "tbody tr")
            shown = [row for row in rows if row.is_displayed()]
            return "".join(re.findall(r"[a-d]", " ".join(row.text for row in shown)))

        first, second = driver.find_elements("css selector", "th button")
        wanted = {first: ("adcb", "cdab"), second: ("abcd", "dcba")}
        for button, orders in wanted.items():
            for each in orders:
                button.send_keys("\ue007")  # Enter
                assert order() == each
        heads = driver.find_elements("css selector", "th")
        sorts = [head.get_attribute("aria-sort") for head in heads]
        assert sorts == [None, "descending"]
        driver.find_element("css selector", "input").send_keys("0.2")
        assert order() == "d"
