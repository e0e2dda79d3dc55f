"""Trials: seeded, resumable, the same goals for every model."""

import contextlib
import json
import math
import shutil
import signal
import subprocess
import sys
from dataclasses import replace

import jax
import msgspec
import numpy as np
import pytest

from models.samples import identified_folder
from models.test_checkpoint import write_network
from report import samples
from sainet.control import record as records
from sainet.control import trials
from sainet.control.config import ControlConfig
from sainet.control.record import SUMMARY, episode_file
from sainet.control.trial import make_trial
from sainet.control.trials import measure_trials, prepare, run_share, run_trials
from sainet.evaluation import summary
from sainet.evaluation.claims import solves_more
from sainet.evaluation.intervals import wilson
from sainet.evaluation.measurements import Measurements
from sainet.evaluation.trials import MEASURES, compare_trials, trial_rows
from sainet.models.identity import ModelId
from sainet.report.verdicts import trial_sentences
from sainet.robots.simulated import PUSH_STEPS, SimulatedRobot
from sainet.runs.documents import read_json, write_json
from sainet.runs.errors import (
    BadCheckpoint,
    BadInput,
    BadSetting,
    RunConflict,
    SainetError,
    UnknownName,
)
from sainet.runs.folders import CONFIG as CONFIG_FILE
from sainet.runs.shards import Shard
from sainet.scenes.recording import Recording
from sainet.studies.run_report import report_of
from support import write_sealed

CONFIG = ControlConfig(model="physics", trials=2, pushes=2)


@pytest.fixture(scope="module")
def done(tmp_path_factory):
    out = tmp_path_factory.mktemp("control") / "out"
    return out, run_trials(CONFIG, out)


def test_finished_trials_write_nothing(done):
    """They can be printed again from a folder that is read-only."""
    out, records = done
    before = (out / SUMMARY).stat()
    again = run_trials(CONFIG, out)
    assert list(map(without_times, again)) == list(map(without_times, records))
    assert (out / SUMMARY).stat().st_ino == before.st_ino


def without_times(record):
    return msgspec.structs.replace(record, decision_s=[])


def test_an_episode_file_is_complete(done):
    out, records = done
    assert [r.trial for r in records] == [0, 1]
    for index, record in enumerate(records):
        written = json.loads(episode_file(out, index).read_text())
        assert written | {"seal": ""} == msgspec.to_builtins(record)
        assert record.reason.startswith("out of pushes: the goal was 177 mm away")
        assert len(record.steps) == record.pushes == 2
        step = record.steps[0]
        assert np.shape(step.actual) == (25, 2, 3)
        assert np.shape(step.planned)[1:] == (2, 3)
        assert abs(step.contact_angle_deg) <= 60
        assert step.evaluated >= 72
        # Toward the goal, and near the planned pose.
        gap = np.subtract(step.actual[-1], step.planned[9])[:, :2]
        assert np.abs(gap).max() < 8
    assert records[0].goal_mm != records[1].goal_mm


def test_finished_episodes_are_kept_and_missing_ones_are_equal(done):
    out, records = done
    kept = episode_file(out, 0).stat().st_mtime_ns
    episode_file(out, 1).unlink()
    (out / SUMMARY).unlink()
    reported = []
    again = run_trials(CONFIG, out, on_episode=reported.append)
    assert episode_file(out, 0).stat().st_mtime_ns == kept
    assert list(map(without_times, again)) == list(map(without_times, records))
    assert reported == again
    with pytest.raises(RunConflict, match="pushes is 2, not 3"):
        run_trials(replace(CONFIG, pushes=3), out)


def test_shards_run_the_same_episodes(done, tmp_path):
    out = tmp_path / "out"
    reported = []
    for number in (2, 1, 2):  # the last finds all there
        shard = Shard(number, 3)
        assert run_share(CONFIG, out, shard, on_episode=reported.append) == 1
    assert [each.trial for each in reported] == [1, 0, 1]
    assert run_share(CONFIG, out, Shard(3, 3)) == 0
    before = episode_file(out, 1).read_bytes()
    episode_file(out, 1).write_bytes(before.replace(b"1", b"2", 1))
    with pytest.raises(BadInput, match=r"001\.json: .*(edited|another episode)"):
        run_trials(CONFIG, out)
    episode_file(out, 1).write_bytes(before)
    records = run_trials(CONFIG, out)
    assert list(map(without_times, records)) == list(map(without_times, done[1]))
    assert not (out / "shards").exists()
    assert run_share(CONFIG, out, Shard(1, 3)) == 1  # finished: nothing is done


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ('{"solved": tr', "Input data was truncated"),
        ("[]", "Expected `object`"),
        ("{}", "missing required field `trial`"),
        ('{"trial": "0"}', "trial: expected `int`"),
    ],
)
def test_a_damaged_episode_is_named_with_a_remedy(tmp_path, done, text, says):
    out = tmp_path / "out"
    shutil.copytree(done[0], out)
    episode_file(out, 0).write_text(text)
    with pytest.raises(BadInput, match=f"000.json: .*{says}.*elete it"):
        run_trials(CONFIG, out)


def test_an_episode_with_nan_is_recorded(tmp_path, monkeypatch):
    def diverge(self, push):
        self.arrange(jax.tree.map(lambda x: x * np.nan, self.truth))
        lost = np.full((PUSH_STEPS + 1, 2, 3), np.nan, np.float32)
        time = np.arange(PUSH_STEPS + 1.0)
        return Recording(time=time, pose=lost, pusher=lost[:, 0, :2], commanded=push)

    monkeypatch.setattr(SimulatedRobot, "push", diverge)
    config = replace(CONFIG, trials=1)
    (record,) = run_trials(config, tmp_path / "out")
    assert (record.solved, record.final_mm) == (False, None)
    assert "NaN" in record.reason
    assert record.steps[0].actual[0] == [[None] * 3] * 2
    found = summarise([record])
    assert (found["solved"], found["within_4_mm"]) == (0, 0.0)
    assert found["median_final_mm"] is None
    monkeypatch.setattr(trials, "run_episode", None)  # what is there is enough
    assert run_trials(config, tmp_path / "out") == [record]


def test_a_network_trained_again_is_another_model(tmp_path):
    net, out = tmp_path / "net", tmp_path / "out"
    config = replace(CONFIG, model=str(write_network(net, seed=0)), trials=1, pushes=1)
    run_trials(config, out)
    write_network(net, seed=1)
    with pytest.raises(RunConflict, match="weights is"):
        run_trials(config, out)


def test_a_folder_of_a_network_may_be_spelled_otherwise(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    net = write_network(tmp_path / "net", seed=0)
    config = replace(CONFIG, model=str(net), trials=1, pushes=1)
    first = run_trials(config, "out")
    assert run_trials(replace(config, model="net"), "out") == first


def test_an_engine_identified_again_is_another_model(tmp_path, monkeypatch):
    monkeypatch.setattr(trials, "run_episode", lambda *args, **settings: None)
    mine, out = tmp_path / "mine", tmp_path / "out"
    config = replace(CONFIG, model=str(mine), trials=1)
    identified_folder(mine, pusher_friction=0.2)
    run_trials(config, out)
    loaded = prepare(config)[0].dynamics.engine.assumptions.pusher_friction
    assert loaded == 0.2
    identified_folder(mine, pusher_friction=0.3)
    loaded = prepare(config)[0].dynamics.engine.assumptions.pusher_friction
    assert loaded == 0.3, "the engine identified before runs on"
    with pytest.raises(RunConflict, match="weights is"):
        run_trials(config, out)


def test_an_interrupted_episode_is_kept_separately(tmp_path, monkeypatch):
    def stop(*args, **settings):
        raise KeyboardInterrupt

    monkeypatch.setattr(trials, "run_episode", stop)
    with pytest.raises(KeyboardInterrupt):
        run_trials(CONFIG, tmp_path / "out")
    left = json.loads((tmp_path / "out/episodes/000.interrupted.json").read_text())
    assert left["reason"] == "interrupted"
    assert not episode_file(tmp_path / "out", 0).exists()


def test_an_error_keeps_the_pushes_and_asks_the_robot_nothing_more(
    tmp_path, monkeypatch
):
    observe, truth, seen = SimulatedRobot.observe, SimulatedRobot.truth, []

    def lose(self):
        seen.append(1)
        if len(seen) > 2:
            raise SainetError("the disks cannot be measured at rest.")
        return observe(self)

    def ask(self):
        assert len(seen) < 2, "asked after the last observation"
        return truth.fget(self)

    monkeypatch.setattr(SimulatedRobot, "observe", lose)
    monkeypatch.setattr(SimulatedRobot, "truth", property(ask))
    with pytest.raises(SainetError, match="at rest"):
        run_trials(replace(CONFIG, pushes=5), tmp_path / "out")
    left = json.loads((tmp_path / "out/episodes/000.interrupted.json").read_text())
    assert (left["reason"], left["pushes"]) == (
        "the disks cannot be measured at rest.",
        2,
    )
    assert not episode_file(tmp_path / "out", 0).exists()


def test_ctrl_c_keeps_the_pushes_of_a_robot_that_cannot_observe_any_more(
    tmp_path, monkeypatch
):
    push, truth, done = SimulatedRobot.push, SimulatedRobot.truth, []

    def end(self, wanted):
        if done:
            done.append(KeyboardInterrupt())
            raise done[-1]
        done.append(push(self, wanted))
        return done[-1]

    def lose(self):
        if len(done) > 1:
            raise SainetError("the disks cannot be measured at rest.")
        return truth.fget(self)

    monkeypatch.setattr(SimulatedRobot, "push", end)
    monkeypatch.setattr(SimulatedRobot, "truth", property(lose))
    with pytest.raises(KeyboardInterrupt):
        run_trials(replace(CONFIG, pushes=5), tmp_path / "out")
    left = json.loads((tmp_path / "out/episodes/000.interrupted.json").read_text())
    assert (left["reason"], left["pushes"]) == ("interrupted", 1)


def test_recorded_poses_are_a_thirtieth_of_a_second_apart_at_any_rate():
    rate, rest = 114.0, np.zeros((80, 2))
    time = np.arange(80) / rate
    pose = np.zeros((80, 2, 3))
    pose[..., 0] = time[:, None]
    found, _ = records._drawn(Recording(time=time, pose=pose, pusher=rest))  # noqa: SLF001
    wanted = np.arange(1, len(found) + 1) / 30
    assert len(found) == int(time[-1] * 30)
    assert np.abs(found[:, 0, 0] - wanted).max() < 1 / rate


_TELLING = """
import functools, pathlib, signal, sys, time
from sainet.control import trials
trials.run_episode = functools.partial(
    trials.run_episode,
    # Slow enough to be interrupted, however busy the machine is.
    on_step=lambda step: (print("pushed", flush=True), time.sleep(0.5)),
)
# A shell has its background jobs ignore the signal, and children inherit that.
signal.signal(signal.SIGINT, signal.default_int_handler)
config = trials.ControlConfig(model="physics", trials=1, pushes=60)
trials.run_trials(config, pathlib.Path(sys.argv[1]))
"""


@pytest.mark.slow
def test_an_interrupted_process_keeps_its_pushes(
    tmp_path,
):
    out = tmp_path / "out"
    command = [sys.executable, "-c", _TELLING, str(out)]
    child = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert child.stdout is not None
    for _ in range(3):
        assert child.stdout.readline() == "pushed\n"
    child.send_signal(signal.SIGINT)
    child.communicate(timeout=60)
    assert child.returncode not in (0, -signal.SIGKILL)
    left = json.loads((out / "episodes/000.interrupted.json").read_text())
    assert left["reason"] == "interrupted"
    assert left["pushes"] == len(left["turns"]) >= 3
    assert not episode_file(out, 0).exists()
    whole = run_trials(replace(CONFIG, trials=1, pushes=60), out)[0]
    assert msgspec.to_builtins(whole.steps[0]) == left["turns"][0]
    assert not (out / "episodes/000.interrupted.json").exists()


def lack(name):
    return lambda record: record["turns"][1].pop(name)


def put(name, value):
    return lambda record: record.update({name: value})


@pytest.mark.parametrize(
    ("damage", "says"),
    [
        (lack("planned"), r"turns\[1\]: .*field `planned`"),
        (lack("distance_mm"), r"turns\[1\]: .*field `distance_mm`"),
        (lambda r: r["turns"].append(3), r"turns\[2\]: expected `object`"),
        (lambda r: r["turns"][0]["actual"].pop(), "pusher and actual differ in length"),
        (put("final", [[1, 2, 3]]), "final has 1 of 2 disks"),
        (put("goal_mm", [1, None]), r"goal_mm\[1\]: expected"),
        (put("goal_mm", [1, "2"]), r"goal_mm\[1\]: expected"),
        (put("decision_s", [1e400]), "JSON is malformed"),
        (put("tolerance_mm", -1.0), "tolerance_mm: expected"),
        (put("final_mm", True), "final_mm: expected"),
        (put("radius_mm", [-54.0, 59.0]), r"radius_mm\[0\]: expected"),
        (put("model", "\ud800"), "JSON is malformed|surrogate|Invalid"),
        (put("moved", 2), "moved is 2 of 2 disks"),
        (put("trial", 1), "trial is 1, which is another episode"),
        (put("solved", True), "solved is True, but final_mm is 1.*and tolerance_mm"),
        (put("final_mm", 1.0), "final_mm is 1, but final is elsewhere"),
        (put("final", [[None] * 3] * 2), "final_mm is 1.*, but final is elsewhere"),
    ],
)
def test_errors_in_an_episode_file_are_named(tmp_path, done, damage, says):
    out = tmp_path / "out"
    shutil.copytree(done[0], out)
    known = json.loads(episode_file(out, 0).read_text())
    damage(known)
    with contextlib.suppress(ValueError):  # what ours never writes
        episode_file(out, 0).write_text(json.dumps(known))
        write_sealed(episode_file(out, 0), known)
    with pytest.raises(BadInput, match=says + ".*elete it"):
        run_trials(CONFIG, out)


@pytest.mark.parametrize("edit", [put("decision_s", [9.0]), lambda r: r.pop("seal")])
def test_an_edited_episode_is_refused(tmp_path, done, edit):
    out = tmp_path / "out"
    shutil.copytree(done[0], out)
    known = json.loads(episode_file(out, 1).read_text())
    edit(known)
    write_json(episode_file(out, 1), known)
    (out / SUMMARY).unlink()  # unfinished
    for again in (lambda: run_trials(CONFIG, out), lambda: report_of(out)):
        with pytest.raises(BadInput, match=r"001\.json: seal: .* Delete it"):
            again()


def test_models_share_worlds_but_not_properties():
    one, same = (make_trial(replace(CONFIG, model=m), 3) for m in ("physics", "in"))
    np.testing.assert_array_equal(one.task.goal, same.task.goal)
    assert one.robot.scene.table_friction == same.robot.scene.table_friction
    nominal = make_trial(replace(CONFIG, given_properties="assumed"), 3)
    np.testing.assert_allclose(nominal.scene.radius, [0.0525, 0.058])
    np.testing.assert_allclose(one.scene.radius, [0.054, 0.059])
    np.testing.assert_array_equal(one.robot.scene.radius, nominal.robot.scene.radius)
    chain = make_trial(replace(CONFIG, disks=3), 3)
    gaps = np.diff(np.asarray(chain.robot.truth.position)[:, 0])
    radius = np.asarray(chain.scene.radius)
    np.testing.assert_allclose(gaps, radius[:-1] + radius[1:], rtol=1e-6)
    assert chain.task.moved == 2


def test_the_stopping_tolerance_may_be_below_the_tolerance(tmp_path, monkeypatch):
    aimed = []
    run = lambda robot, planner, dynamics, task, scene, **_: aimed.append(task)  # noqa: E731
    monkeypatch.setattr(trials, "run_episode", run)
    for stop in (1.0, 0.8):
        config = replace(CONFIG, trials=1, stopping_tolerance=stop)
        (judged,) = run_trials(config, tmp_path / str(stop))
        assert judged.tolerance_mm == pytest.approx(5.9)
        assert aimed[-1].tolerance == pytest.approx(stop * 0.1)
    settings = [read_json(tmp_path / name / CONFIG_FILE) for name in ("1.0", "0.8")]
    assert [one["stopping_tolerance"] for one in settings] == [1.0, 0.8]


@pytest.mark.parametrize(
    ("changes", "error", "says"),
    [
        ({"model": "nothing"}, UnknownName, "nothing"),
        ({"planner": "cem"}, UnknownName, "greedy"),
        ({"world": "havok"}, UnknownName, "planar"),
        ({"deadline": 1.0}, BadInput, "`deadline`"),
    ],
)
def test_impossible_settings_are_refused_before_any_output(
    tmp_path, changes, error, says
):
    with pytest.raises(error, match=says):
        run_trials(replace(CONFIG, **changes), tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_a_network_for_other_controls_is_refused(tmp_path):
    folder = write_network(tmp_path / "net", kind="direct-force")
    with pytest.raises(BadCheckpoint, match="kind is 'direct-force'"):
        run_trials(replace(CONFIG, model=str(folder)), tmp_path / "out")


@pytest.mark.parametrize(
    ("name", "value"),
    [
        *(("trials", 0), ("pushes", 0), ("disks", 1), ("seed", -1)),
        *(("tolerance", 0.0), ("tolerance", 1.5), ("alignment", -1.0)),
        *(("deadline", 0.0), ("stopping_tolerance", 0.0), ("stopping_tolerance", 1.1)),
        *(("deadline", math.inf), ("alignment", math.inf), ("alignment", math.nan)),
    ],
)
def test_bad_settings_are_named(name, value):
    with pytest.raises(BadInput, match=f"^`{name}` is {value:g}"):
        ControlConfig(**{name: value})


def test_the_weight_of_the_alignment_is_refused_for_a_row_that_is_steered():
    with pytest.raises(
        BadSetting, match="alignment.* unless the target disk is disk 2"
    ):
        ControlConfig(disks=3, alignment=5.0).check_used()
    ControlConfig(disks=3, moved=2, alignment=5.0).check_used()


def summarise(records):
    (row,) = trial_rows(measure_trials({ModelId(kind="in"): records}))
    return row.to_dict()


def paired_test(one, other, measure="solved"):
    """The test of two models on the same goals."""
    models = {ModelId(kind="in"): other, ModelId(kind="sain"): one}
    found = {test.measure: test for test in compare_trials(measure_trials(models))}
    return msgspec.structs.asdict(found[measure])


def records_of(solved, pushes=20, final=3.0, reason="solved"):
    usual = {"final_mm": final, "reason": reason, "decision_s": [0.1, 0.3]}
    made = {
        each: samples.record(solved=each, tolerance_mm=5.9 if each else 1.0, **usual)
        for each in set(solved)
    }
    return [msgspec.structs.replace(made[each], pushes=pushes) for each in solved]


def test_success_has_wilsons_interval():
    found = summarise(records_of([True] * 22 + [False] * 3))
    assert (found["solved"], found["success"]) == (22, 0.88)
    # Wilson (1927) by hand: z = 1.96.
    z, n, p = 1.959964, 25, 0.88
    middle = (p + z**2 / (2 * n)) / (1 + z**2 / n)
    half = z / (1 + z**2 / n) * np.sqrt(p * (1 - p) / n + z**2 / (4 * n**2))
    assert found["interval"] == pytest.approx([middle - half, middle + half], abs=1e-6)
    assert found["median_pushes"] == 20
    assert found["median_decision_s"] == pytest.approx(0.2)
    assert found["within_4_mm"] == 1.0
    assert found["within_25_pushes"] == 0.88
    assert summarise(records_of([False]))["median_pushes"] is None


def test_failures_after_a_measured_success_are_counted():
    seen, lost = (records_of([False], reason=r) for r in ("solved", "out of pushes"))
    found = summarise(records_of([True]) + seen + 2 * lost)
    assert (found["solved"], found["ended_early"]) == (1, 1)


def test_pairs_are_compared_exactly():
    one, other = records_of([True] * 9 + [False]), records_of([True] * 3 + [False] * 7)
    found = paired_test(one, other)
    assert (found["only_one"], found["only_other"]) == (6, 0)
    assert found["p"] == pytest.approx(2 * 0.5**6)
    assert paired_test(one, one)["p"] == 1.0


def test_trials_of_one_lab_are_not_independent():
    """Models that differ in one of five labs only differ by chance."""
    alike = records_of([True, False] * 10)
    mine, theirs = ([*records_of([each] * 20), *4 * alike] for each in (True, False))
    models = {ModelId(kind="in"): theirs, ModelId(kind="sain"): mine}
    pooled, labs = measure_trials(models), np.repeat(np.arange(5, dtype=np.int32), 20)
    data = pooled.data.assign_coords(fold=("sample", labs))
    header = msgspec.structs.replace(pooled.header, has_labs=True)
    found = summary.summarise(Measurements(data, header))
    assert paired_test(mine, theirs)["p"] < 1e-5
    assert solves_more("sain", "in", "")(found).status == "does not hold"
    (p,) = (test.p for test in found.tests if test.measure == "solved")
    assert p > 0.05
    assert any(f"(p over labs = {p:.2g})" in each for each in trial_sentences(found))
    # Success scatters over labs, as its complement does: Wilson's interval is narrower.
    for row, outcome in zip(found.trials, found.outcomes, strict=True):
        solved = outcome.values["solved"]
        assert row.interval == pytest.approx((solved.low, solved.high))
        assert np.ptp(row.interval) > 1.5 * np.ptp(wilson(row.success, 100))
    # Where no trial differs, Wilson's.
    never = found.outcomes[0].values["stuck"]
    assert (never.low, never.high) == pytest.approx(wilson(0.0, 100))


def test_pairs_are_compared_by_each_measure():
    fine = records_of([True])
    late, far = records_of([True], pushes=26), records_of([True], final=4.1)
    for other, apart in ((late, "within_25_pushes"), (far, "within_4_mm")):
        found = {measure: paired_test(fine, other, measure) for measure in MEASURES}
        unlike = {measure: pair["only_one"] for measure, pair in found.items()}
        assert unlike == dict.fromkeys(MEASURES, 0) | {apart: 1}
        assert not any(pair["only_other"] for pair in found.values())
