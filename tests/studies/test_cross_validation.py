"""`sainet cross-validate`: nothing of a test push is used in a fit; the command."""

import contextlib
import io
import json
import re
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

import sainet as sn
from learning.stores import end_points_alone, info_of, made_up, write
from sainet.cli.cross_validate import CrossValidate
from sainet.cli.entry import run
from sainet.datasets.store import open_store
from sainet.models.card import read_identified
from sainet.models.identity import ModelId
from sainet.models.process_card import read_process_card
from sainet.report.palette import labels_of
from sainet.runs.digests import pushes_overlap
from sainet.runs.errors import BadStore
from sainet.studies.candidates import ProcessCandidate, candidates_named
from sainet.studies.cross_validation import cross_validated
from sainet.studies.runner import Runner
from sainet.studies.validation import cross_validate

PUSHES, FOLDS = 64, 2
MODELS = ("physics", "physics-identified", "gp-identified-angle")


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """Pushes of one disk on two surfaces, in pairs of repeats."""
    groups = ("felt", "wood")
    info = info_of(
        PUSHES, engine="recorded", seed=None, bodies=1, groups=groups, has_repeats=True
    )
    arrays = end_points_alone(made_up(info))
    arrays |= {"group": np.repeat([0, 1], PUSHES // 2)}
    arrays |= {"repeat": np.repeat(np.arange(PUSHES // 2), 2)}
    frictions = dict.fromkeys(
        ("table_friction", "disk_friction", "pusher_friction"), np.full(PUSHES, 0.3)
    )
    folder = tmp_path_factory.mktemp("recorded") / "data"
    return write(folder, info, arrays | frictions).path


@pytest.fixture(scope="module")
def command(recorded, tmp_path_factory):
    """The words of a small cross-validation, and its folder."""
    out = tmp_path_factory.mktemp("validated") / "out"
    given = ["--data", str(recorded), "--out", str(out), "--folds", str(FOLDS)]
    chosen = ["--models", "gp-angle", "--by", "kind", "--json", "--quiet"]
    given += ["--group", "wood"]
    return ["cross-validate", *given, *chosen], out


@pytest.fixture(scope="module")
def printed(command):
    text = io.StringIO()
    with contextlib.redirect_stdout(text):
        assert run(command[0]) == 0
    return json.loads(text.getvalue())


def test_each_push_is_tested_once_by_models_that_did_not_see_it(recorded):
    store = open_store(recorded)
    models = candidates_named(["gp-angle"])
    whole = cross_validated(store, ("kind",), FOLDS, models)
    assert [condition.parts for condition in whole.unions] == [
        ("kind, felt", "kind, wood")
    ]
    hashes, tested = store.push_hashes(), []
    for part in whole.parts:
        for step in part.parts:
            seen = step.engine.pushes.store
            assert {each.engine for each in step.fitted} == {step.engine}
            assert not set(seen.repeats()) & set(step.pushes.store.repeats())
            assert len(set(seen.read(slice(None), ("group",))["group"])) == 1
            tested += step.pushes.store.push_hashes().tolist()
    assert sorted(tested) == sorted(hashes.tolist())


def test_the_command_gives_verdict_errors_and_page(printed, command):
    out = command[1]
    assert printed["verdict"].endswith(".")
    assert printed["recommendation"]["model"] in MODELS
    assert (out / "measurements.nc").is_file()
    page = (out / "report.html").read_text()
    assert "Is learning worth it" in page
    assert printed["page"] == str(out / "report.html")
    assert len(printed["next"]) == 1


def test_the_models_of_a_fold_were_fitted_to_its_training_pushes(
    printed, command, recorded
):
    store, cards = open_store(recorded), []
    for folder in sorted((command[1] / "steps").glob("gp-*")):
        cards.append(read_process_card(folder))
    assert len(cards) == FOLDS
    for card in cards:
        seen = pushes_overlap(card.pushes, store.push_hashes())
        assert seen == card.trained_pushes < PUSHES / 2


def test_an_identical_command_fits_nothing_again(printed, command, capsys, monkeypatch):
    # Nothing is left to do that is worth the start of processes.
    pool = "sainet.runs.executors.worker_pool"
    monkeypatch.setattr(pool, lambda *_, **__: ThreadPoolExecutor(1))
    steps = command[1] / "steps"
    before = {p: p.stat().st_mtime_ns for p in steps.rglob("*") if p.is_file()}
    assert run(command[0]) == 0
    assert json.loads(capsys.readouterr().out) == printed
    assert {p: p.stat().st_mtime_ns for p in before} == before
    engines = [read_identified(folder) for folder in steps.glob("identify-*")]
    assert len(engines) == FOLDS


def test_shards_give_the_same_numbers(printed, command, tmp_path, capsys):
    words = [*command[0], "--out", str(tmp_path)]
    for number in (1, 2):
        assert run([*words, "--shard", f"{number}/2"]) == 0
        said = json.loads(capsys.readouterr().out)
        assert said == {"shard": f"{number}/2", "done": 3, "waiting": 0}
    assert run([*words, "--shard", "1/2", "--folds", "3"]) == 2
    assert "folds is 2, not 3" in capsys.readouterr().err
    assert run(words) == 0
    shown = capsys.readouterr()
    assert json.loads(shown.out) == printed | {"page": str(tmp_path / "report.html")}
    assert "missing" not in shown.err
    assert not (tmp_path / "shards").exists()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--shard", "3/2"], "--shard is 3/2; it must be a number and a count"),
        (["--folds", "1"], "folds.*at least 2"),
        (["--by", "chain", "chain"], "--by is chain chain; it must be one or more"),
        (["--by"], "--by is empty; it must be one or more different divisions"),
        (["--folds", "17"], "32 pushes, 16 of them different by kind.* 17 folds"),
        (["--group", "glass"], "no group 'glass'"),
        (["--pushes", "99"], "32 pushes, not 99"),
        (["--table", "errors.doc"], "table.*\\.md"),
    ],
)
def test_bad_settings_end_in_one_line(command, options, message, capsys):
    words = [*command[0], *options]
    assert run(words) == 2
    error = capsys.readouterr().err.strip()
    assert error.count("\n") == 0
    assert re.search(message, error)


def test_a_script_gives_the_same_verdict(recorded, command, printed):
    found = sn.cross_validate(
        sn.open_pushes(recorded).of_group("wood"),
        by="kind",
        folds=FOLDS,
        models=("gp-angle",),
        out=command[1],
    )
    assert found.verdict() == printed["verdict"]
    assert "Physics" in str(found)
    with pytest.raises(BadStore, match="do not fill"):
        sn.cross_validate(recorded, folds=PUSHES)


def test_the_next_commands_are_for_the_pushes_of_the_verdict():
    gp, network = ModelId(kind="gp", features="side"), ModelId(kind="sain")
    data, both = Path("runs/my pushes"), {"abs": 120, "plywood": 80}
    given = CrossValidate(data=data, pushes=200)
    assert given._commands(gp, both) == [
        f"sainet tune gp --features side --data 'runs/my pushes' --group {each} "
        f"--pushes {count} --out runs/model-{each}"
        for each, count in both.items()
    ]
    (one,) = CrossValidate(data=Path("d"), group="abs-10")._commands(
        network, {"abs": 9}
    )
    assert one == (
        "sainet identify --data d --group abs-10 --out runs/identified && sainet tune "
        "sain --features paper --data d --group abs-10 --out runs/model "
        "--engine runs/identified"
    )


def test_the_next_command_makes_a_model_as_it_was_validated():
    data = {"d": 9}
    for name, model, option in (
        ("gp-side-chosen", "tune gp --features side", " --choose"),
        ("sain-place-ensemble", "tune sain --features place", "--members 5"),
    ):
        (found,) = candidates_named([name])
        (one,) = CrossValidate(data=Path("d"))._commands(found.identity, data)
        assert model in one
        assert option in one


def test_ensembles_and_chosen_processes_are_compared(recorded, tmp_path, monkeypatch):
    from sainet.studies import candidates, recorded_models

    monkeypatch.setattr(candidates, "MEMBERS", 2)
    few = recorded_models.RESIDUAL.changed(iterations=2)
    monkeypatch.setattr(recorded_models, "RESIDUAL", few)
    monkeypatch.setattr("sainet.learning.ensemble._FEWEST", 3)
    store = open_store(recorded).of_group("wood")
    models = candidates_named(["sain-ensemble", "gp-side-chosen"])
    found = cross_validate(store, ("kind",), FOLDS, models, Runner(tmp_path))
    assert found.order[2:] == [
        "sain-identified-residual-ensemble",
        "gp-identified-side-chosen",
    ]
    for slug in found.order[2:]:
        assert np.isfinite(found.measured.values("final_pos_mm", slug)).all()
        label = labels_of(found.summary.models)[slug]
        assert any(label in sentence for sentence in found.coverage)


def test_candidates_come_from_the_simplest():
    found = candidates_named(["gp-place", "gp-angle"])
    assert found == (ProcessCandidate("angle"), ProcessCandidate("place"))


def test_pushes_that_a_candidate_cannot_be_fitted_to_are_refused_at_once(tmp_path):
    info = info_of(PUSHES, engine="recorded", seed=None, bodies=3)
    store = write(tmp_path / "three", info, end_points_alone(made_up(info)))
    with pytest.raises(BadStore, match="3 disks.*network .*`models` sain sain-p"):
        cross_validated(store, ("kind",), FOLDS, candidates_named(["gp-angle"]))
    with pytest.raises(BadStore, match="20 pushes, of which 4 would calibrate"):
        candidates_named(["sain-ensemble"])[0].check(store.first(20))
