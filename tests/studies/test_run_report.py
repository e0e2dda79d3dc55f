"""The report of a run folder, whatever made it, and however damaged it is."""

import json
import shutil

import msgspec
import pytest
from markupsafe import escape

from report import samples
from sainet.control.record import FOLDER
from sainet.models.library import PRETRAINED
from sainet.report.figures.curves import draw_learning_curve
from sainet.report.figures.paths import draw_paths
from sainet.runs.documents import write_document, write_json
from sainet.runs.errors import BadInput
from sainet.studies import STUDIES, load_study
from sainet.studies.run_report import figures_of, page_of, report_of
from sainet.studies.study import TABLE, Result
from studies.test_simulated_control import result as control_table
from support import write_sealed


def test_a_training_run_has_its_card_and_curve(tmp_path):
    folder = tmp_path / "net"
    shutil.copytree(PRETRAINED / "sain", folder)
    draw_learning_curve(samples.histories(), folder / "learning-curve.svg")
    page = page_of(folder)
    assert "The loss while the network learned." in page
    assert page.count("<svg") == 1
    for told in ("truth engine", "bullet", "learning rate", "0.001", "data seed"):
        assert told in page


@pytest.mark.parametrize(
    ("file", "way_out"),
    [
        ("hashes.json", "; 'sainet inspect {}' describes its pushes."),
        ("report.html", "; open {}/report.html."),
    ],
)
def test_a_folder_that_another_page_shows_names_it(file, way_out, tmp_path):
    (tmp_path / file).touch()
    with pytest.raises(BadInput) as caught:
        report_of(tmp_path)
    wanted = f"{tmp_path}: nothing to show in it{way_out.format(tmp_path)}"
    assert str(caught.value) == wanted


def test_errors_episodes_and_figures_come_together(tmp_path):
    write_json(tmp_path / "config.json", {"command": "control", "seed": 3})
    write_document(tmp_path / TABLE, Result(summary=samples.result()))
    for trial in range(8):
        path = tmp_path / FOLDER / f"{trial:03d}.json"
        write_sealed(path, samples.record_json(trial=trial))
    (tmp_path / FOLDER / "008.interrupted.json").write_text("cut sho")
    draw_paths(samples.replay(), tmp_path / "paths.svg")
    (tmp_path / "of-somebody.svg").write_text("<svg onload='alert(1)'/>")
    report = report_of(tmp_path)
    assert len(report.episodes) == 6
    assert "Output of 'sainet control'" in report.subtitle
    page = page_of(tmp_path)
    assert "Prediction errors" in page
    assert "alert" not in page


def test_every_figure_of_a_study_has_a_caption(tmp_path):
    drawn = {name for name in STUDIES if load_study(name).figure}
    for name in drawn:
        (tmp_path / f"{name}.svg").touch()
    assert {path.stem for path, _ in figures_of(tmp_path)} == drawn


def test_goals_are_a_table_of_their_own(tmp_path):
    row = msgspec.structs.replace(control_table().trials[0], condition="<b>easy</b>")
    summary = msgspec.structs.replace(control_table(), trials=(row,))
    folder = tmp_path / "my run"
    write_document(folder / TABLE, Result(summary=summary))
    page = page_of(folder)
    assert escape(f"sainet report '{folder}'") in page
    assert "Goals reached" in page
    assert "&lt;b&gt;easy&lt;/b&gt;" in page
    assert "<b>easy" not in page
    assert "McNemar" in page


def test_identified_parameters_are_in_the_report(tmp_path):
    known = {"name": "pusher_friction", "value": 0.31, "low": 0.3, "high": 0.32}
    estimates = [
        {**known, "start": 0.25, "doubt": None},
        {**known, "name": "spin", "start": 0.25, "doubt": "it never spins"},
    ]
    errors = {"before_mm": 2, "after_mm": 1, "before_deg": 5, "after_deg": 4}
    found = {"estimates": estimates, "pushes": 12, **errors}
    found |= {"format_version": 2, "engine": {"simulator": {"engine": "planar"}}}
    write_sealed(tmp_path / "identified.json", found)
    page = page_of(tmp_path)
    assert "Pusher friction: 0.31 (0.3 to 0.32), initially 0.25." in page
    assert "spin is not identifiable: it never spins." in page
    assert "Mean errors where 12 pushes were observed: position 2.00 mm before" in page


def test_hidden_content_of_a_figure_is_left_out(tmp_path):
    hidden = "<!-- <svg onload='alert(1)'> -->"
    doctype = "<!DOCTYPE svg [<!ENTITY a \"<svg onload='alert(2)'>\">]>"
    labelled = samples.replay(models=("me@home url(x)",))
    drawn = draw_paths(labelled, tmp_path / "paths.svg")
    body = drawn.read_text()
    body = body[body.index("<svg") :]
    drawn.write_text(f"{doctype}{hidden}{body}")
    page = page_of(tmp_path)
    assert "alert" not in page
    assert "me@home url(x)" in page  # a label is text
    assert page.count("<svg") == 3  # one for each panel


@pytest.mark.parametrize(
    ("name", "text", "told"),
    [
        (None, None, "nothing to show"),
        ("table.json", "{}", "`summary`"),
        ("table.json", '{"summary": {"models": [], "rows": 3}}', "`array`"),
        ("table.json", "[]", "`object`"),
        ("identified.json", '{"estimates": [{}]}', "format_version"),
        ("card.json", "{}", "format_version"),
        ("episodes/000.json", "{}", "missing required field"),
        (
            "paths.svg",
            "<svg><script>alert(1)</script></svg>",
            "<script> does not",
        ),
        ("paths.svg", "<svg><g onclick='alert(1)'/></svg>", "<g> does not"),
        ("paths.svg", "<svg><g ONCLICK='alert(1)'/></svg>", "<g> does not"),
        ("paths.svg", "<svg ONLOAD='alert(1)'/>", "<svg> does not"),
        (
            "paths.svg",
            "<svg><use href='https://x.org/a'/></svg>",
            "<use> does not",
        ),
        (
            "paths.svg",
            "<svg><use HREF='https://x.org/a'/></svg>",
            "<use> does not",
        ),
        (
            "paths.svg",
            "<svg><g style='fill: URL(//x.org)'/></svg>",
            "<g> does not",
        ),
        (
            "paths.svg",
            "<svg><style>@import '//x.org'</style></svg>",
            "<style> does not",
        ),
        ("paths.svg", "<svg>", "cannot be read as a figure"),
    ],
)
def test_hostile_and_damaged_files_are_named(name, text, told, tmp_path):
    if name is not None:
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text)
    with pytest.raises(BadInput, match=told) as error:
        page_of(tmp_path)
    assert str(tmp_path) in str(error.value)
    assert len(str(error.value).splitlines()) == 1


def test_an_edited_table_is_refused(tmp_path):
    write_document(tmp_path / TABLE, Result(summary=samples.result()))
    text = (tmp_path / TABLE).read_text()
    (tmp_path / TABLE).write_text(text.replace("3.6", "0.36", 1))
    with pytest.raises(BadInput, match=r"table\.json: seal: the file was edited"):
        report_of(tmp_path)


def test_a_folder_of_run_folders_names_one_of_them(tmp_path):
    write_json(tmp_path / "robot-planar-quick" / TABLE, json.loads("{}"))
    with pytest.raises(BadInput, match="example, .*robot-planar-quick"):
        report_of(tmp_path)
    with pytest.raises(BadInput, match="no such folder"):
        report_of(tmp_path / "nowhere")
