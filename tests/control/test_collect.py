"""Collecting sessions: one file per push, resumable, and a dataset at the end."""

import json
import os
import shutil
import signal
import subprocess
import sys
from dataclasses import replace
from importlib.util import find_spec

import jax.numpy as jnp
import numpy as np
import pytest
from msgspec import structs

from sainet.cli.entry import run
from sainet.control import collect as module
from sainet.control.collect import DATASET, SUMMARY, collect, push_file, summary_of
from sainet.control.collected import read_push, write_push
from sainet.control.config import CollectConfig
from sainet.datasets.store import open_store
from sainet.engines.simulator import PAPER_RADIUS
from sainet.robots import make_robot
from sainet.robots.lab.hidden import draw_lab
from sainet.robots.simulated import SimulatedRobot
from sainet.runs.errors import BadInput, BadSetting, RunConflict, SainetError
from sainet.scenes.pushes import Push
from sainet.scenes.state import at_rest
from sainet.worlds.sampling import scattered
from support import require

CONFIG = CollectConfig(pushes=8, seed=5)
DISTANCE = 0.054 + 0.059  # m, of centres of touching disks


@pytest.fixture(scope="module")
def done(tmp_path_factory):
    out = tmp_path_factory.mktemp("collect") / "out"
    return out, collect(CONFIG, out)


def pushes_of(out, count=CONFIG.pushes):
    return [read_push(push_file(out, index)) for index in range(count)]


def content(out):
    return {
        path.relative_to(out): path.read_bytes()
        for path in sorted(out.rglob("*"))
        if path.is_file() and path.name != "manifest.json"
    }


def test_every_push_starts_with_touching_disks_in_the_work_area(done):
    for each in pushes_of(done[0]):
        place = np.array(each.observed.pose)[:, :2]
        assert np.linalg.norm(place[1] - place[0]) == pytest.approx(DISTANCE, abs=1e-3)
        assert np.abs(place).max() < 0.151
        assert abs(each.commanded.contact_angle) <= np.pi / 3
        assert abs(each.commanded.direction) <= np.pi / 6
        assert (each.commanded.length, each.trouble) == (pytest.approx(0.010), "")
        start = np.hypot(*np.subtract(each.pusher[0], place[0]))
        assert start == pytest.approx(0.054 + 0.0048, abs=1e-5)


def test_disks_stay_where_the_last_push_left_them(done):
    found = pushes_of(done[0])
    assert found[0].arranged
    assert summary_of(done[0]).arrangements == sum(each.arranged for each in found)
    kept = [(a, b) for a, b in zip(found, found[1:], strict=False) if not b.arranged]
    assert kept
    for before, after in kept:
        off = np.subtract(before.left.pose, after.observed.pose)
        assert np.abs(off[:, :2]).max() < 1e-3  # noise of motion capture


def test_disks_that_left_the_work_area_are_arranged_again(tmp_path):
    config = replace(CONFIG, area_mm=130.0, pushes=6)
    collect(config, tmp_path / "out")
    found = pushes_of(tmp_path / "out", 6)
    assert sum(each.arranged for each in found) > 1
    headings = [np.subtract(*np.array(e.observed.pose)[:, :2]) for e in found]
    assert np.ptp([np.arctan2(*each) for each in headings]) > 0.5


def test_the_dataset_has_measured_poses_and_assumed_frictions(done):
    store = open_store(done[0] / DATASET)
    assert (store.info.pushes, store.info.bodies, store.info.engine) == (
        8,
        2,
        "recorded",
    )
    arrays = store.read(slice(None))
    np.testing.assert_array_equal(arrays["table_friction"], np.float32(0.15))
    np.testing.assert_allclose(arrays["mass"], np.tile([0.9, 1.0], (8, 1)), rtol=1e-6)
    for row, each in enumerate(pushes_of(done[0])):
        wanted = np.array(each.pose)[1:]
        found = arrays["truth"][row, :, :, :3]
        np.testing.assert_allclose(found, wanted, atol=1e-5)
        rest = found[150:, 0, :2].std(axis=0)  # noise of motion capture
        assert 1e-4 < rest.mean() < 2e-4
    assert arrays["pose_observed"].all()


def test_a_killed_session_resumes_to_the_same_bytes(done, tmp_path):
    out = tmp_path / "out"
    words = ["record", "--pushes", "8", "--seed", "5", "--out", str(out)]
    command = [sys.executable, "-m", "sainet", *words]
    with subprocess.Popen(command, stderr=subprocess.DEVNULL) as process:
        while not push_file(out, 1).is_file() and process.poll() is None:
            pass
        os.kill(process.pid, signal.SIGKILL)
    assert not (out / SUMMARY).exists()
    assert run(words) == 0
    assert content(out) == content(done[0])


def test_a_push_that_is_missing_is_made_again_with_all_later_ones(done, tmp_path):
    out = tmp_path / "out"
    shutil.copytree(done[0], out)
    shutil.rmtree(out / DATASET)
    for path in (out / SUMMARY, push_file(out, 3)):
        path.unlink()
    collect(CONFIG, out)
    assert content(out) == content(done[0])


def test_other_settings_are_refused(done, capsys):
    before = content(done[0])
    assert run(["record", "--pushes", "9", "--seed", "5", "--out", str(done[0])]) == 2
    assert "pushes is 8, not 9" in capsys.readouterr().err
    with pytest.raises(RunConflict, match="seed"):
        collect(replace(CONFIG, seed=6), done[0])
    assert content(done[0]) == before


def test_repeated_pushes_share_their_plan_and_start(tmp_path):
    out = tmp_path / "out"
    store = collect(replace(CONFIG, pushes=4, repeats=2), out)
    assert store.repeats().tolist() == [0, 0, 1, 1]
    first, again, other, _ = pushes_of(out, 4)
    assert first.commanded == again.commanded != other.commanded
    off = np.subtract(first.observed.pose, again.observed.pose)
    assert 0 < np.abs(off[:, :2]).max() < 1e-3
    assert first.pose != again.pose


def test_pushes_in_trouble_are_counted_and_left_out(tmp_path, monkeypatch):
    push = SimulatedRobot.push

    def stumble(self, wanted):
        made = push(self, wanted)
        is_odd = float(wanted.contact_angle) > 0
        return replace(made, trouble="feedback stopped") if is_odd else made

    monkeypatch.setattr(SimulatedRobot, "push", stumble)
    monkeypatch.setattr(module, "MOST_TROUBLES", 100)
    store = collect(CONFIG, tmp_path / "out")
    found = summary_of(tmp_path / "out")
    (count,) = found.troubles.values()
    assert set(found.troubles) == {"feedback stopped"}
    assert 0 < count == 8 - store.info.pushes == found.pushes - found.usable


def test_troubles_in_a_row_stop_the_session(tmp_path, monkeypatch):
    push = SimulatedRobot.push
    failing = lambda self, p: replace(push(self, p), trouble="feedback stopped")  # noqa: E731
    monkeypatch.setattr(SimulatedRobot, "push", failing)
    with pytest.raises(SainetError, match="feedback stopped, 3 times in a row"):
        collect(CONFIG, tmp_path / "out")
    assert len(list((tmp_path / "out" / "recordings").iterdir())) == 3


def test_planned_pushes_go_towards_a_goal(tmp_path):
    out = tmp_path / "out"
    config = replace(CONFIG, pushes=4, planner="greedy", model="physics")
    collect(config, out)
    found = pushes_of(out, 4)
    kept = [b for a, b in zip(found, found[1:], strict=False) if not b.arranged]
    assert kept
    for each in found:
        goal = np.array(each.goal)
        before, after = (np.array(p.pose)[1, :2] for p in (each.observed, each.left))
        assert np.linalg.norm(after - goal) < np.linalg.norm(before - goal)
    assert found[1].goal == found[0].goal or found[1].arranged


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("{", "nput data was truncated"),
        ('{"index": 1}', "missing required field"),
    ],
)
def test_a_damaged_push_is_named_with_a_remedy(done, tmp_path, text, says):
    out = tmp_path / "out"
    shutil.copytree(done[0], out)
    (out / SUMMARY).unlink()
    push_file(out, 7).write_text(text)
    with pytest.raises(BadInput, match=f"000007.json: .*{says}.*elete it"):
        collect(CONFIG, out)


def test_an_edited_push_is_refused(done, tmp_path):
    out = tmp_path / "out"
    shutil.copytree(done[0], out)
    (out / SUMMARY).unlink()
    text = push_file(out, 7).read_text()
    push_file(out, 7).write_text(text.replace('"trouble":""', '"trouble":"none"'))
    with pytest.raises(BadInput, match="000007.json: seal: .*edited. Delete it"):
        collect(CONFIG, out)


def test_pushes_of_other_disks_do_not_become_one_dataset(done, tmp_path):
    out = tmp_path / "out"
    shutil.copytree(done[0], out)
    (out / SUMMARY).unlink()
    other = structs.replace(read_push(push_file(out, 7)), radius=[0.058, 0.059])
    write_push(push_file(out, 7), other)
    with pytest.raises(BadInput, match="000007.json: its disks are not .*delete it"):
        collect(CONFIG, out)


def test_a_push_of_another_index_is_refused(done, tmp_path):
    path = tmp_path / "000004.json"
    path.write_bytes(push_file(done[0], 3).read_bytes())
    with pytest.raises(BadInput, match="index is 3"):
        read_push(path)
    document = json.loads(path.read_text())
    path.write_text(json.dumps(document | {"index": 4, "time": document["time"][1:]}))
    with pytest.raises(BadInput, match="differ in length"):
        read_push(path)


@pytest.mark.parametrize(
    ("settings", "says"),
    [
        ({"pushes": 0}, "`pushes` is 0"),
        ({"area_mm": float("nan")}, "`area_mm` is nan"),
        ({"gap_mm": 0.0}, "`gap_mm` is 0"),
        ({"planner": "best"}, "`planner` is best"),
        ({"robot": "abb"}, "`config` is None"),
        ({"robot": "lab", "disks": 3}, "`disks` is 3"),
        ({"robot": "lba"}, "did you mean lab"),
        ({"swapped": True}, "`swapped` is True"),
        ({"area_mm": 112.0}, "`area_mm` is 112; it must be from 113 to 10000 mm"),
        ({"disks": 4}, "`area_mm` is 300; it must be from 339 to 10000 mm"),
    ],
)
def test_settings_out_of_range_are_refused(settings, says):
    with pytest.raises(BadSetting, match=says):
        CollectConfig(**settings)


@pytest.mark.parametrize("command", ["record", "control"])
def test_a_work_area_without_room_is_refused(command, tmp_path, capsys):
    out = tmp_path / "out"
    line = f"{command} --robot lab --area-mm 100 --out {out}"
    assert run(line.split()) == BadInput.exit_status
    assert (
        "--area-mm is 100; it must be from 111 to 10000 mm" in capsys.readouterr().err
    )
    assert not out.exists()


@pytest.mark.parametrize("swapped", [False, True])
def test_a_work_area_has_room_from_its_least_size_on(swapped):
    for lab in range(100):
        config = CollectConfig(robot="lab", lab=lab, swapped=swapped)
        apart = sum(disk.radius for disk in draw_lab(lab, config.surface).disks)
        assert 1000 * apart < 111
    rng = np.random.default_rng(0)
    for _ in range(300):
        scattered(rng, np.array(PAPER_RADIUS), 0.111)


def test_a_session_in_a_virtual_lab_resumes_to_the_same_bytes(tmp_path):
    require(find_spec("mujoco"), "MuJoCo is not installed")
    config = CollectConfig(robot="lab", lab=1, surface="plywood", pushes=4, seed=2)
    whole, part = tmp_path / "whole", tmp_path / "part"
    store = collect(config, whole)
    shutil.copytree(whole, part)
    shutil.rmtree(part / DATASET)
    for path in (part / SUMMARY, push_file(part, 2)):
        path.unlink()
    collect(config, part)
    assert content(part) == content(whole)
    assert store.info.groups == ("plywood-50",)
    assert store.info.pushes == 4
    for each in pushes_of(whole, 4):
        # Disks and pusher have clocks of their own.
        assert each.pose.count([[None] * 3] * 2) > 10 < each.pusher.count([None] * 2)


def test_angles_of_a_virtual_lab_do_not_jump_at_half_a_turn():
    require(find_spec("mujoco"), "MuJoCo is not installed")
    robot = make_robot(CollectConfig(robot="lab"), 0)
    robot.arrange(at_rest(robot.truth.position, jnp.full(2, np.pi), jnp.zeros(2)))
    robot.observe()
    push = Push(*(jnp.float32(x) for x in (0.5, 0.3, 0.01, 0.05)))
    angle = robot.push(push).pose[..., 2]
    assert np.ptp(angle[np.isfinite(angle).all(axis=1)], axis=0).max() < 0.3
