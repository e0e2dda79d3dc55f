"""Datasets are divided, models evaluated, and tables shown and saved."""

import csv
import gc

import numpy as np
import pytest

import sainet as sn
from sainet.models.dynamics import PhysicsDynamics
from sainet.runs.errors import BadInput, BadSetting, BadStore, RunConflict

CONFIG = sn.GenerateConfig(pushes=4, chunk_size=4, stroke_mm=(2.0,), hold_steps=30)


@pytest.fixture(scope="module")
def table(folder) -> sn.ErrorTable:
    pushes = sn.open_pushes(folder / "runs" / "recorded")
    still = sn.from_function(
        lambda scene, initial, controls: np.zeros(
            (*controls.position.shape[:2], 2, 3), np.float32
        ),
        name="still",
    )
    return sn.evaluate({"physics": "physics", "still": still, "net": "in"}, pushes)


def test_pushes_are_divided_without_loss(pushes):
    train, test = pushes.split(test=0.25, seed=1)
    assert (len(train), len(test)) == (9, 3)
    both = np.concatenate([train.hashes, test.hashes])
    assert set(both) == set(pushes.hashes)
    assert set(test.hashes) != set(pushes.split(test=0.25, seed=2)[1].hashes)
    assert len(pushes.first(5).take([0, 4])) == 2
    assert repr(test).startswith("<3 pushes of 2 disks, simulated by planar: ")


@pytest.mark.parametrize("test", [0, 1, -0.1, float("nan")])
def test_an_impossible_share_is_refused(pushes, test):
    with pytest.raises(BadSetting, match="above 0 and below 1"):
        pushes.split(test=test)


def test_a_batch_has_what_predict_takes(pushes):
    batch = pushes.first(3).batch(steps=10)
    found = sn.load("physics").predict(batch.scene, batch.initial, batch.controls)
    assert found.states.position.shape == (3, 10, 2, 2)


def test_a_missing_dataset_is_refused(tmp_path):
    with pytest.raises(BadStore, match="no such dataset"):
        sn.open_pushes(tmp_path / "nothing")
    with pytest.raises(BadStore, match="no such dataset"):
        sn.identify(str(tmp_path / "nothing"))


def test_generated_pushes_are_deleted_with_the_last_reference():
    pushes = sn.generate(CONFIG)
    path = pushes.store.path
    part = pushes.first(2)
    del pushes
    gc.collect()
    assert len(part.hashes) == 2  # read from the folder
    del part
    gc.collect()
    assert not path.exists()


def test_generated_pushes_stay_in_a_folder(tmp_path):
    out = str(tmp_path / "pushes")
    sn.generate(CONFIG, out)
    assert len(sn.open_pushes(out)) == 4
    with pytest.raises(RunConflict):
        sn.generate(sn.GenerateConfig(pushes=5), out)


def test_rows_have_the_errors_of_each_model_and_disk(table):
    rows = table.rows
    assert [(row["model"], row["body"]) for row in rows] == [
        (model, body) for model in ("physics", "still", "net") for body in (1, 2)
    ]
    errors = table.measured.values("pos_mm", "still")
    assert rows[3]["pos_mm"] == pytest.approx(errors[:, 1].mean())
    assert rows[3]["pos_mm_low"] < rows[3]["pos_mm"] < rows[3]["pos_mm_high"]
    frame = table.to_pandas()
    assert frame.to_dict("records") == rows


def test_the_verdict_names_models_as_the_table_does(table):
    best, other = table.verdict().splitlines()
    assert best.startswith("net errs by ")
    assert other.startswith("net against still: better in pos of disk")
    assert (
        "No verdict" in sn.evaluate({"alone": "physics"}, sn.generate(CONFIG)).verdict()
    )
    assert table.verdict() in str(table)


def test_a_table_is_saved_as_its_ending_says(table, tmp_path):
    for name in ("a.html", "a.md", "a.tex", "a.csv"):
        assert table.save(tmp_path / name) == tmp_path / name
        text = (tmp_path / name).read_text()
        assert "still" in text
    page = (tmp_path / "a.html").read_text()
    assert page.startswith("<!doctype html>")
    assert "12 pushes" in page
    assert page.count("net errs by") == 2  # at the top and below the table
    assert page.count("net against still") == 1
    with (tmp_path / "a.csv").open() as file:
        assert [row["Model"] for row in csv.DictReader(file)] == [
            *("Physics", "still", "net")
        ]
    with pytest.raises(BadSetting, match="one of .md, .html, .tex, .csv"):
        table.save(tmp_path / "a.xls")
    assert not (tmp_path / "a.xls").exists()


def test_a_notebook_shows_an_escaped_table(pushes, tmp_path):
    physics = sn.load("physics")
    table = sn.evaluate({"<b>": physics}, pushes.first(2))
    assert "<b>" not in table._repr_html_()
    assert "&lt;b&gt;" in table._repr_html_()
    page = table.save(tmp_path / "one.html").read_text()
    assert "Errors of 1 model on 2 pushes" in page


def test_models_are_given_by_name_or_as_objects(pushes):
    class Engine(PhysicsDynamics):
        """Physics under another name."""

    dynamics = Engine(sn.PlanarEngine())
    table = sn.evaluate([dynamics, sn.load("physics-true"), "in"], pushes.first(2))
    assert table.measured.slugs == ["engine", "physics-true", "in"]


def test_names_that_are_no_models_are_refused(pushes):
    with pytest.raises(BadInput, match="give a list, or a model for each"):
        sn.evaluate("sain", pushes)
    with pytest.raises(BadInput, match="not all different"):
        sn.evaluate(["physics", "physics"], pushes)
    with pytest.raises(BadInput, match="did you mean sain"):
        sn.load("sian")


def test_progress_is_shown_where_it_is_asked_for(pushes, capsys):
    sn.evaluate(["physics"], pushes.first(2))
    assert capsys.readouterr().err == ""
    sn.evaluate(["physics"], pushes.first(2), progress=True)
    assert "Predicting" in capsys.readouterr().err


def test_engines_and_starts_that_cannot_be_used_are_refused(pushes):
    with pytest.raises(BadInput, match="`engine` is in; it must be physics"):
        sn.tune("sain", pushes, engine="in")
    with pytest.raises(BadInput, match="`start` is physics, which has no folder"):
        sn.tune("sain", pushes, start=sn.load("physics"))
    with pytest.raises(BadInput, match="`start` is sain, and `recipe` has another"):
        sn.tune("sain", pushes, start="sain", recipe=sn.Recipe())


def test_a_model_of_a_folder_is_trained_further(pushes, tmp_path):
    first = sn.tune("in", pushes, start="in", iterations=1, out=tmp_path / "first")
    again = sn.tune("in", pushes, start=first, iterations=1, seed=3)
    assert again.card is not None
    assert again.card.started_from == first.digest
    assert again.card.recipe.seed == 3
    assert (again.folder, again.name) == (None, "in")
