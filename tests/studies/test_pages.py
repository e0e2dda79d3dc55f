"""Pages of results: rendering them again changes nothing, and no number is typed."""

import re

import pytest
from msgspec import structs

from sainet.evaluation.measurements import read_measurements
from sainet.models.card import IDENTIFIED
from sainet.runs.documents import write_document, write_json
from sainet.runs.errors import BadInput
from sainet.runs.manifest import MANIFEST, manifest
from sainet.studies import STUDIES, load_study
from sainet.studies.evidence import Benchmark, Evidence, keep
from sainet.studies.pages import BEGIN, END, TEMPLATES, rendered, verdict, with_block
from sainet.studies.study import ENGINE_ERRORS, MEASUREMENTS
from support import REPOSITORY

# Digits may stand outside rendered blocks in code, links, versions, years, tables and
# figures of the paper, and names of disks.
_EXEMPT = (
    r"```.*?```",
    r"`[^`\n]*`",
    r"\]\([^)]*\)",
    r"Python \d+\.\d+",
    r"\b(ICRA|Ajay et al\.,?) \(?\d{4}\)?",
    r"\bl2\b",
    r"\b([Dd]isks?|[Ff]igure|section|Apache-)\s?\d+(\.\d+)?[a-z]?",
    r"arXiv:[\d.]+",
    r"examples/\w+",
    r"<img[^>]*>",
)


def numbers_in(text: str) -> list[str]:
    """Return the lines of a text that state a number outside rendered blocks."""
    rendered = re.escape(BEGIN) + ".*?" + re.escape(END)
    for pattern in (rendered, *_EXEMPT):
        text = re.sub(pattern, "", text, flags=re.DOTALL)
    return [line for line in text.splitlines() if re.search(r"\d", line)]


@pytest.mark.slow
def test_rendering_again_changes_nothing():
    pages = rendered(REPOSITORY)
    assert {path for path in pages if path.read_text("utf-8") != pages[path]} == set()
    known = {path for path in pages if path.parent.name == "results"}
    assert known == set((REPOSITORY / "docs" / "results").glob("*.md"))


def test_no_number_in_a_template_is_typed():
    for path in (REPOSITORY / TEMPLATES).glob("*.j2"):
        prose = re.sub(r"{[{%].*?[%}]}", "", path.read_text("utf-8"), flags=re.DOTALL)
        assert numbers_in(prose) == [], path.name
    assert numbers_in((REPOSITORY / "README.md").read_text("utf-8")) == []


def test_evidence_stays_small():
    files = [path for path in (REPOSITORY / "results").rglob("*") if path.is_file()]
    sizes = [path.stat().st_size for path in files]
    assert 0 < sum(sizes) < 20 << 20
    assert max(sizes) < 5 << 20


def test_a_typed_number_is_found_and_a_rendered_one_is_not():
    assert numbers_in("SAIN errs by 0.6 mm") == ["SAIN errs by 0.6 mm"]
    for text in ("`--pushes 4500`", f"{BEGIN}0.6 mm{END}", "disk 2", "Python 3.11"):
        assert numbers_in(text) == []


def test_a_text_without_a_place_for_its_block_is_refused():
    assert with_block(f"a\n{BEGIN}old\n{END}\nb", "new\n") == f"a\n{BEGIN}new\n{END}\nb"
    with pytest.raises(ValueError, match="no <!-- rendered"):
        with_block("# sainet", "new")


def test_a_page_is_of_its_template_and_its_evidence(tmp_path):
    for name in ("results", TEMPLATES):
        (tmp_path / name).mkdir(parents=True)
    titles = (
        "{% for name, title in titles.items() %}{{ name }}: {{ title }}\n{% endfor %}"
    )
    templates = {
        "readme-block": "readme-block",
        "benchmarks": "{% set title = 'Timings' %}"
        "{{ bench('training', {'iteration_ms': 'one iteration (ms)'}) }}",
        "findings": "{% set title = 'Findings' %}{{ findings }}",
        "index": titles + "By hand: {{ transcribed | join }}",
    }
    for name, text in templates.items():
        (tmp_path / TEMPLATES / f"{name}.md.j2").write_text(text)
    figures: dict[str, float | str | None] = {"devices": 2, "iteration_ms": 91.68}
    found = Benchmark(figures | {"reason": None}, machine="ours", transcribed=True)
    write_document(tmp_path / "results" / "bench-training.json", found)
    (tmp_path / "README.md").write_text(f"{BEGIN}{END}")
    pages = {path.name: text for path, text in rendered(tmp_path).items()}
    assert pages["README.md"] == f"{BEGIN}readme-block\n{END}"
    rows = pages["benchmarks.md"].splitlines()
    assert rows.index("| one iteration (ms) | 91.68 |") < rows.index(
        "| `devices` | 2 |"
    )
    assert not any("None" in row for row in rows)
    assert pages["index.md"] == (
        "benchmarks.md: Timings\nfindings.md: Findings\nBy hand: benchmarks.md\n"
    )


def test_a_verdict_is_of_a_claim_that_the_study_states():
    study, (claim, *_) = "varied-or-fixed", load_study("varied-or-fixed").claims
    summary = Evidence(REPOSITORY).summary(study)
    assert verdict(study, claim.text, summary) == "**does not hold**"
    with pytest.raises(ValueError, match="unpack"):
        verdict(study, "another claim", summary)


def test_a_page_states_every_claim_of_its_study():
    for name in STUDIES:
        page = REPOSITORY / "docs" / "results" / f"{name}.md"
        text = page.read_text("utf-8") if page.is_file() else ""
        for claim in load_study(name).claims if text else ():
            assert f"Claim: {claim.text}. Verdict: " in text, name


def test_measurements_of_a_study_are_kept_at_published_precision(tmp_path):
    folder, root = tmp_path / "engine-parity-quick", tmp_path / "repository"
    whole = read_measurements(REPOSITORY / "results" / "engine-parity.nc.xz")
    whole.write(folder / MEASUREMENTS)
    write_json(folder / "config.json", {"study": "engine-parity"})
    (folder / ENGINE_ERRORS).write_text("<svg/>")
    keep(folder, root)
    (kept,) = (root / "results").iterdir()
    assert kept.name == "engine-parity.nc.xz"
    assert read_measurements(kept).to_bytes() == whole.to_bytes()
    assert (
        root / "docs" / "figures" / f"engine-parity-{ENGINE_ERRORS}"
    ).read_text() == "<svg/>"
    with pytest.raises(BadInput, match="config.json"):
        keep(tmp_path / "no-study", root)


def test_identified_parameters_are_kept_by_group(tmp_path):
    one = Evidence(REPOSITORY).identifications()["abs-10"]
    write_document(tmp_path / "abs-10" / IDENTIFIED, one.found)
    write_document(tmp_path / "abs-10" / MANIFEST, manifest())
    keep(tmp_path / "abs-10", tmp_path)
    (again,) = Evidence(tmp_path).identifications().items()
    assert again[0] == "abs-10" and again[1].found == one.found


def test_figures_of_benchmarks_are_kept_case_by_case(tmp_path):
    path = tmp_path / "bench.json"
    path.write_text('Measuring ...\n{"engines": {"batch": 3, "bullet_ratio": null}}\n')
    keep(path, tmp_path)
    found = Evidence(tmp_path).benchmark("engines")
    assert found.figures == {"batch": 3, "bullet_ratio": None}
    assert str(manifest().processor) in found.machine
    for text in ("", "{}x", '{"batch": 3}', "[1]"):
        path.write_text(text)
        with pytest.raises(BadInput, match=r"bench.json: no figures by case \("):
            keep(path, tmp_path)


def test_episodes_are_kept_by_their_goals_in_the_order_of_models(tmp_path):
    known = Evidence(REPOSITORY).episodes()["easy-3-disks"]
    path = tmp_path / "run" / "episodes" / f"{known[0].trial:03d}.json"
    for record in reversed(known):
        write_document(path, record)
        keep(path, tmp_path)
    assert Evidence(tmp_path).episodes() == {"easy-3-disks": known}
    models = [record.model for record in known]
    assert models == ["physics-true", "sain", "sain-any"]
    assert [record.solved for record in known] == [True, False, True]  # as on the page
    write_document(path, structs.replace(known[0], model="runs/mine"))
    with pytest.raises(BadInput, match="model is runs/mine, not one of"):
        keep(path, tmp_path)
    (tmp_path / "results/episodes/easy-3-disks/sain.json.xz").write_bytes(b"cut")
    with pytest.raises(BadInput, match=r"sain.json.xz: no episode \("):
        Evidence(tmp_path).episodes()


def test_every_claim_with_evidence_is_among_the_findings():
    found = (REPOSITORY / "docs/results/findings.md").read_text("utf-8")
    for name in STUDIES:
        if (REPOSITORY / "results" / f"{name}.nc.xz").is_file():
            for claim in load_study(name).claims:
                assert f"| {claim.text} |" in found, name
