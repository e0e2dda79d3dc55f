"""Studies in the virtual lab, tiny; what they count and measure, by hand."""

import json
import math
from dataclasses import replace
from importlib.util import find_spec

import msgspec
import numpy as np
import pytest

from report import samples
from sainet.cli.entry import run
from sainet.control.collect import collect
from sainet.control.config import CollectConfig, ControlConfig
from sainet.control.record import EpisodeRecord, read_record
from sainet.control.trial import make_trial
from sainet.control.trials import measure_trials, prepare
from sainet.evaluation.as_json import to_json_object
from sainet.evaluation.evaluate import evaluate
from sainet.evaluation.joining import join
from sainet.evaluation.lab_outcomes import OUTCOMES
from sainet.evaluation.measurements import Condition
from sainet.evaluation.summary import Summary, summarise
from sainet.models.library import load_model
from sainet.report.verdicts import trial_sentences
from sainet.scenes.pushes import push_axis
from sainet.studies import lab_control, lab_pushes, load_study
from sainet.studies.lab_control import solves_share
from sainet.studies.lab_prediction import FLOOR, REPEATED, TESTS, errs_at_most, scatter
from sainet.studies.lab_pushes import Sizes, of_lab
from sainet.studies.paper_setup import SAIN
from studies.test_simulated_control import row
from support import require

LABS = (
    "lab-collect",
    "lab-prediction",
    "lab-control",
    "lab-new-surface",
    "lab-swapped-disks",
)


@pytest.fixture
def tiny_labs(monkeypatch):
    require(find_spec("mujoco"), "MuJoCo is not installed")
    sizes = {"quick": Sizes(2, 6, 4, 2, 2, (2, 4))}
    monkeypatch.setattr(lab_pushes, "SIZES", sizes)
    monkeypatch.setattr(lab_control, "TRIALS", {"quick": (1, 2)})
    monkeypatch.setattr("sainet.studies.paper_setup._QUICK_ITERATIONS", 1)
    monkeypatch.setattr("sainet.studies.paper_setup._QUICK_BATCH", 2)


@pytest.mark.slow
def test_every_lab_study_runs(make, tiny_labs):
    found = {name: make(name) for name in LABS}
    groups = {each["group"] for each in found["lab-collect"]["rows"]}
    assert groups == {"abs", "plywood"}
    rows = found["lab-prediction"]["rows"]
    at_tests = {each["model"]: each["n"] for each in rows if each["group"] == TESTS}
    assert at_tests.keys() >= {"in", "sain", "in-tuned", "sain-tuned", "physics-true"}
    assert set(at_tests.values()) == {4}  # two test pushes in each of two labs
    assert FLOOR.slug in {e["model"] for e in rows if e["group"] == REPEATED}
    for name in LABS[2:]:
        models = [each["model"] for each in found[name]["rows"]]
        assert models == ["sain", "sain-tuned"] * (len(models) // 2)
        assert {each["trials"] for each in found[name]["rows"]} == {2}
        measures = {each["measure"] for each in found[name]["differences"]}
        assert measures == set(OUTCOMES)


@pytest.mark.parametrize("name", LABS)
def test_results_are_called_those_of_a_virtual_lab(name):
    study = load_study(name)
    texts = [study.question, *(claim.text for claim in study.claims)]
    assert all("virtual lab" in text.lower() for text in texts)
    assert not any("real" in text.lower() for text in texts)


def test_published_values_are_those_of_the_paper_in_conditions_of_the_study():
    published = load_study("lab-prediction").published
    tuned = published[-1]
    assert (tuned.condition, tuned.model.slug) == (TESTS, "sain-tuned")
    assert tuned.values["pos_mm"] == (1.50, 1.52)
    control = load_study("lab-control").published
    assert [each.values["success"] for each in control] == [
        (1.0,),
        (0.68,),
        (1.0,),
        (0.96,),
    ]


def test_the_floor_is_the_scatter_of_repetitions(tmp_path):
    """The noise of motion capture alone makes repetitions of a quiet push differ."""
    config = CollectConfig(pushes=12, repeats=6, noise_level="default", seed=1)
    store = collect(config, tmp_path / "out")
    found = scatter(store)
    errors = found.values("final_pos_mm", FLOOR.slug)
    assert errors.shape == (12, 2)
    # At least the noise of two measured poses, start and end: 0.21 mm on each axis.
    assert 0.15 < errors.mean() < 1.5
    one = scatter(store.take([0, 6]))  # nothing to compare with: no scatter
    np.testing.assert_allclose(one.values("pos_mm", FLOOR.slug), 0, atol=1e-9)


def test_joined_labs_have_intervals_over_labs(tmp_path):
    store = collect(CollectConfig(pushes=3), tmp_path / "out")
    measured = evaluate([load_model("physics")], store)
    found = of_lab(measured, 3)
    assert found.header.has_labs
    assert set(found.data["fold"].values) == {3}
    assert summarise(found).rows[0].values["pos_mm"].low is not None


def test_a_share_of_an_error_is_ruled_by_its_mean_on_each_disk():
    def ruled(*scales: float) -> str:
        rows = [samples.row("sain", body, 1.0) for body in (1, 2)]
        for body, scale in enumerate(scales, start=1):
            rows.append(samples.row("sain-tuned", body, scale))
        return errs_at_most("sain-tuned", "sain", 0.6, "")(samples.summary(rows)).status

    assert ruled(0.5, 0.6) == "holds"
    assert ruled(0.5, 0.61) == "does not hold"
    assert ruled() == "not testable here"


def test_a_share_of_goals_is_ruled_by_the_trials_of_the_condition():
    rule = solves_share("sain", 0.98, "hard, tree")
    found = Summary(models=(SAIN,), trials=(row("sain"),))
    assert rule(found).status == "holds"
    fewer = (row("sain", solved=97, success=0.97),)
    assert rule(msgspec.structs.replace(found, trials=fewer)).status == "does not hold"
    assert rule(Summary(models=(SAIN,))).status == "not testable here"


def places(*way: float) -> list[list[list[float]]]:
    """Return places of two disks; the second is so far ahead (mm)."""
    return [[[0.0, 0.0, 0.0], [each, 0.0, 0.0]] for each in way]


def episode(*way: float, **changes: object) -> EpisodeRecord:
    """Return an episode in which the target disk was at these places."""
    made = samples.record_json(pushes=len(way) - 1)
    for step, observed in zip(made["turns"], places(*way), strict=False):
        step["observed"] = observed
    made |= {"final": places(*way)[-1]} | changes
    away = math.dist(made["final"][1][:2], made["goal_mm"])
    # Solved or not, whatever the distance is.
    made |= {"final_mm": away, "tolerance_mm": 2 * away if made["solved"] else away / 2}
    return msgspec.convert(made, EpisodeRecord)


def test_the_overshoot_is_the_most_that_the_disk_was_beyond_its_goal():
    assert episode(100.0, 140.0, 149.0).overshoot_mm == 0
    assert episode(100.0, 157.0, 152.0).overshoot_mm == pytest.approx(7.0)
    assert episode(100.0, 140.0, 153.0).overshoot_mm == pytest.approx(3.0)
    aside = [[0.0, 0.0, 0.0], [150.0, 90.0, 0.0]]
    assert episode(100.0, 140.0, final=aside).overshoot_mm == pytest.approx(0.0)


def test_an_episode_is_stuck_where_ten_pushes_came_no_nearer():
    near = [100.0, 120.0, 140.0]
    assert episode(*near, *[135.0] * 10, solved=False).is_stuck
    assert not episode(*near, *[135.0] * 9, solved=False).is_stuck
    assert not episode(*near, *[135.0] * 10, solved=True).is_stuck


def test_outcomes_in_labs_have_paired_differences():
    tuned = msgspec.structs.replace(SAIN, data="tuned")
    parts = []
    for lab in range(3):
        good = [episode(100.0, 149.0, trial=n) for n in range(4)]
        lost = [episode(100.0, 141.0, solved=n > lab, trial=n) for n in range(4)]
        measured = measure_trials({SAIN: lost, tuned: good}, Condition(label="hard"))
        parts.append(of_lab(measured, lab))
    found = summarise(join(parts))
    sain, other = (each.values for each in found.outcomes)
    assert sain["solved"].value == pytest.approx(0.5)
    assert other["solved"].value == other["within_2_mm"].value == 1
    gain, *_ = found.differences
    assert (gain.measure, gain.model, gain.against) == ("solved", "sain-tuned", "sain")
    assert gain.difference.value == pytest.approx(0.5)
    low, high = gain.difference.low, gain.difference.high
    assert low is not None and high is not None and low < 0.5 < high
    assert {"outcomes", "differences"} <= to_json_object(found).keys()
    assert any(
        "solved: SAIN, tuned minus SAIN +0.500" in s for s in trial_sentences(found)
    )


def test_assumed_properties_follow_swapped_disks_or_stay_in_order():
    config = ControlConfig(robot="lab", swapped=True, model="physics")
    follows, _ = prepare(config)
    stays, _ = prepare(replace(config, given_properties="assumed"))
    assert follows.internal is not None and stays.internal is not None
    assert follows.internal.simulator.assumptions.radius == (0.058, 0.0525)
    assert stays.internal.simulator.assumptions.radius == (0.0525, 0.058)
    assert follows.name == stays.name == "physics"
    require(find_spec("mujoco"), "MuJoCo is not installed")
    trial = make_trial(config, 0)
    np.testing.assert_allclose(trial.scene.radius, (0.058, 0.0525), atol=2e-4)
    kept = make_trial(replace(config, given_properties="assumed"), 0)
    np.testing.assert_allclose(kept.scene.radius, (0.0525, 0.058), atol=1e-9)
    axis = float(push_axis(trial.robot.truth))
    way = np.asarray(trial.task.goal) - np.asarray(trial.robot.truth.position[1])
    off = abs(np.mod(np.arctan2(way[1], way[0]) - axis + np.pi, 2 * np.pi) - np.pi)
    assert off <= np.pi / 6 + 1e-6  # an easy goal


def test_episodes_in_a_virtual_lab_are_recorded_and_printed(tmp_path, capsys):
    require(find_spec("mujoco"), "MuJoCo is not installed")
    words = ["control", "--robot", "lab", "--lab", "2", "--surface", "plywood"]
    words += ["--model", "physics", "--trials", "1", "--pushes", "2"]
    out = tmp_path / "out"
    assert run([*words, "--out", str(out), "--workers", "1", "--json", "--quiet"]) == 0
    printed = json.loads(capsys.readouterr().out.splitlines()[-1])
    places = {name: printed[name] for name in ("robot", "lab", "surface", "swapped")}
    assert places == {
        "robot": "lab",
        "lab": 2,
        "surface": "plywood",
        "swapped": False,
    }
    (record,) = out.glob("episodes/*.json")
    for step in read_record(record).steps:
        assert len(step.actual) == len(step.pusher) > 5
        poses = np.array(step.actual, float)  # of the tracker's clock alone
        assert np.isfinite(poses).all()
        assert np.isfinite(np.array(step.pusher, float)).all()
        # The disks are where the next push was planned from.
        off = poses[-1, :, :2] - np.array(step.observed)[:, :2]
        assert 2 < np.linalg.norm(off[0]) < 14
