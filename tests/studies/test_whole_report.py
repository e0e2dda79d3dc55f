"""One page with all studies: what was run, what it rules, what was not and why."""

import re

import pytest

from report import samples
from sainet.evaluation.claims import Claim, errs_less
from sainet.models.identity import ModelId
from sainet.report.pages.page import to_page
from sainet.runs.documents import write_document
from sainet.runs.errors import BadInput
from sainet.studies import STUDIES, load_study
from sainet.studies.durations import Clock
from sainet.studies.steps import Load
from sainet.studies.study import TABLE, Result
from sainet.studies.whole_report import folder_of, whole_report

RUN = ("robot-two-disks", "letter")


@pytest.fixture
def out(tmp_path):
    for name in RUN:
        folder = folder_of(tmp_path, name, "quick")
        write_document(folder / TABLE, Result(summary=samples.result()))
    return tmp_path


def report(out, scale="quick", steps=()):
    missing = {"lab-realism": "`recorded` is missing: give it."}
    return whole_report(out, scale, missing, steps, Clock(out), command="sainet")


def test_every_study_is_on_the_page_or_not_run_with_a_reason(out):
    made = report(out)
    assert [part.name for part in made.parts] == [n for n in STUDIES if n in RUN]
    (not_run,) = (t for t in made.plain_tables if t.title == "Not run")
    reasons = dict(not_run.rows)
    assert reasons.keys() | set(RUN) == STUDIES.keys()
    assert reasons["lab-realism"] == "`recorded` is missing: give it."
    assert reasons["gaps"] == "not asked for"
    assert f"2 of {len(STUDIES)} studies, at the scale quick" in made.subtitle


def test_results_of_the_other_scale_are_left_out(out):
    paper = report(out, "paper")
    assert paper.parts == []
    assert "hardly" in report(out).summary and not paper.summary


def test_a_claim_is_ruled_on_only_if_its_study_was_run(out):
    (claims,) = (t for t in report(out).plain_tables if t.title == "The paper's claims")
    ruled = {row[-1].partition(";")[0]: row[2] for row in claims.rows}
    assert ruled["direct-force-two-disks"] == "not run"
    assert ruled["robot-two-disks"] != "not run"


def test_durations_are_summed_by_the_kind_of_work(out, monkeypatch):
    clock = Clock(out)
    steps = [Load(ModelId(kind=name), name) for name in ("in", "sain")]
    monkeypatch.setattr("sainet.studies.durations._SHORTEST", -1.0)
    for step in steps:
        with clock.time(step):
            pass
    *_, durations = report(out, steps=steps).plain_tables
    assert [row[:2] for row in durations.rows] == [("Load", "2")]


def test_the_page_links_to_each_study_and_counts_its_figures_through(out):
    figure = '<svg width="10pt" xmlns="http://www.w3.org/2000/svg"></svg>'
    for name in RUN:
        for each in ("learning-curve", "paths"):
            (folder_of(out, name, "quick") / f"{each}.svg").write_text(figure)
    page = to_page(report(out))
    for name in RUN:
        assert f'<a href="#{name}">' in page and f'<section id="{name}">' in page
    assert re.findall(r"<b>Figure (\d+)", page) == ["1", "2", "3", "4"]
    identifiers = re.findall(r'\bid="([^"]+)"', page)
    assert len(set(identifiers)) == len(identifiers)


def test_a_damaged_result_is_named(out):
    path = folder_of(out, RUN[0], "quick") / TABLE
    path.write_text("{}")
    with pytest.raises(BadInput, match=re.escape(str(path))):
        report(out)


def test_the_page_shows_the_ruling_on_each_claim_of_a_study(out, monkeypatch):
    study = load_study(RUN[0])
    claim = Claim("A errs <less> than B", errs_less("sain", "physics"))
    monkeypatch.setitem(study.__dict__, "claims", (claim,))
    page = to_page(report(out))
    assert "Claim: A errs &lt;less&gt; than B. Verdict:" in page
