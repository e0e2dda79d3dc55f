"""The session behind the page: its physics is that of the robot and the episode."""

import fcntl
import math
import os
from dataclasses import replace

import numpy as np
import pytest

from sainet.control.config import ControlConfig
from sainet.control.episode import run_episode
from sainet.control.trial import make_trial
from sainet.models.library import load_model
from sainet.planning import make_planner
from sainet.report.live.album import Album
from sainet.report.live.config import PlayConfig
from sainet.report.live.messages import (
    Aim,
    BadMessage,
    ChooseModel,
    ChooseWorld,
    MoveDisk,
    MoveGoal,
    PlanNow,
    PushNow,
    Restart,
    Save,
    SetProperties,
)
from sainet.report.live.predictions import Difference, push_at
from sainet.report.live.session import Session
from sainet.report.live.views import Moved
from sainet.robots import make_robot
from sainet.runs.errors import BadInput, BadSetting, RunConflict
from sainet.scenes.state import poses_of
from sainet.studies.run_report import page_of

SEED = 3
CONFIG = PlayConfig(model=("physics", "physics-true"), seed=SEED)
PUSH = PushNow(20.0, -10.0)


@pytest.fixture
def session(tmp_path):
    """A session whose models are physics: these compile quickly."""
    return Session(replace(CONFIG, out=tmp_path / "play"))


def poses(session):
    return np.array([disk.pose for disk in session.view.disks])


def test_a_push_is_that_of_the_simulated_robot_with_the_same_seed(session):
    for number in range(3):
        session.act(Aim(number, 10.0 * number, 0.0))  # predictions draw no noise
    (moved,) = session.act(PUSH)
    robot = make_robot(ControlConfig(seed=SEED), SEED, 0)
    robot.observe()
    recording = robot.push(push_at(20.0, -10.0))
    assert isinstance(moved, Moved)
    true = poses_of(robot.truth)
    assert np.array_equal(poses_of(session.trial.robot.truth), true)
    shown = np.array(moved.step.actual[-1])
    last = recording.pose[-1] * [1000, 1000, np.rad2deg(1)]
    assert np.abs(shown - last).max() < 0.006
    errors = next(each for each in moved.ghosts.ghosts if each.model == "physics")
    off = 1000 * np.linalg.norm(true[0, :2] - np.array(errors.pose)[0, :2] / 1000)
    assert errors.difference_mm[0] == pytest.approx(off, abs=0.02)
    assert off > 0.1  # the world is not what physics assumes


def test_planned_pushes_are_those_of_an_episode(session):
    session.act(ChooseModel("physics"))
    for _ in range(3):
        session.act(PlanNow())
    config = ControlConfig(model="physics", goals="hard", seed=SEED)
    trial = make_trial(config, 0)
    physics = load_model("physics").dynamics
    planner = make_planner("greedy")
    run_episode(trial.robot, planner, physics, trial.task, trial.scene, pushes=3)
    ours, theirs = session.trial.robot.truth, trial.robot.truth
    assert np.array_equal(poses_of(ours), poses_of(theirs))


def test_differences_are_distances_and_angles():
    one, other = np.zeros((2, 3)), np.array([[0.003, 0.004, 0.1], [0, 0, 2 * np.pi]])
    found = Difference.between(one, other)
    assert found.mm == pytest.approx([5.0, 0.0])
    assert found.deg == pytest.approx([math.degrees(0.1), 0.0], abs=1e-3)


def test_predictions_differ_from_the_first_model(session):
    (ghosts,) = session.act(Aim(7, 30.0, 10.0))
    assert (ghosts.number, ghosts.against) == (7, "physics")
    first, second = ghosts.ghosts
    assert first.difference_mm == [0.0, 0.0]
    expected = np.array(first.pose) - np.array(second.pose)
    assert second.difference_mm == pytest.approx(
        np.linalg.norm(expected[:, :2], axis=1), abs=0.02
    )
    assert max(second.difference_mm) > 0.05


REFUSED = {
    "overlap": (MoveDisk(2, 30.0, 0.0), "overlap disk 1 by"),
    "no such disk": (MoveDisk(3, 0.0, 0.0), "no disk 3; there are disks 1 to 2"),
    "disk 0": (MoveDisk(0, 0.0, 0.0), "no disk 0; there are disks 1 to 2"),
    "disk off the table": (MoveDisk(1, 900.0, 0.0), "off the table"),
    "goal off the table": (MoveGoal(0.0, -600.0), "off the table"),
    "unknown model": (ChooseModel("../secret"), "choose physics, physics-true"),
    "three in the lab": (ChooseWorld("lab", "none", 3), "2 in the virtual lab"),
    "one mass": (SetProperties([1.0], [50.0, 50.0], 0.2), "those of 2 disks"),
    "pusher in disk 2": (PushNow(180.0, 0.0), "start inside disk 2"),
    "nothing to save": (Save(), "no push to save"),
}


@pytest.mark.parametrize(("message", "reason"), REFUSED.values(), ids=REFUSED)
def test_what_is_refused_changes_nothing(session, message, reason):
    before, generator = session.view, session.moment
    with pytest.raises(BadInput, match=reason):
        session.act(message)
    assert session.view == before
    assert session.moment is generator
    assert not session.config.out.exists()


def test_the_page_is_told_why_a_push_is_impossible(session):
    (ghosts,) = session.act(Aim(1, 180.0, 0.0))
    assert "disk 2" in ghosts.blocked
    assert not ghosts.ghosts


def test_disks_and_goal_stay_where_they_are_put(session):
    session.act(MoveDisk(2, 100.0, -100.0))
    (view,) = session.act(MoveGoal(200.0, -100.0))
    assert view.disks[1].pose == [100.0, -100.0, 0.0]
    assert view.distance_mm == pytest.approx(100.0, abs=1e-3)
    (view,) = session.act(MoveGoal(101.0, -100.0))
    assert view.is_solved


def test_larger_disks_move_apart_and_keep_the_goal(session):
    goal = session.view.goal_mm
    (view,) = session.act(SetProperties([2.0, 0.5], [75.0, 75.0], 0.3))
    assert view.goal_mm == goal
    assert [disk.mass_kg for disk in view.disks] == [2.0, 0.5]
    place = poses(session)[:, :2]
    assert np.linalg.norm(place[1] - place[0]) == pytest.approx(150.0, abs=0.02)
    friction = float(session.trial.robot.scene.table_friction)
    assert friction == pytest.approx(0.3)
    given = session.trial.scene  # models are given no true friction
    assert float(given.table_friction) == pytest.approx(0.15)
    assert given.mass.tolist() == [2.0, 0.5]


def test_episodes_are_saved_for_a_report_and_never_overwritten(session):
    session.act(PUSH)
    session.act(Save())
    session.act(PUSH)
    session.act(Restart())
    session.act(MoveGoal(0.0, 0.0))  # an episode without a push is not kept
    session.act(PUSH)
    saved, view = session.act(Save())
    out = session.config.out
    assert (view.episodes, str(out) in saved.text) == (2, True)
    assert len(list((out / "episodes").glob("*.json"))) == 2
    page = page_of(out)
    assert "hard goal 1: ended by the user after 2 pushes" in page
    assert "chosen goal 2: ended by the user after 1 push" in page
    later = Session(session.config)
    later.act(PUSH)
    later.act(Save())
    assert len(list((out / "episodes").glob("*.json"))) == 3


def test_two_pages_do_not_save_to_one_folder(session):
    session.act(PUSH)
    session.act(Save())
    # A descriptor of its own has locks of its own, as another process has.
    other, kind = (
        os.open(session.config.out, os.O_RDONLY),
        fcntl.LOCK_EX | fcntl.LOCK_NB,
    )
    with pytest.raises(BlockingIOError):
        fcntl.flock(other, kind)
    session.album = Album(session.config.out)  # lets the folder go
    fcntl.flock(other, kind)
    with pytest.raises(RunConflict, match="another sainet process"):
        session.act(Save())
    os.close(other)
    session.act(Save())


def test_another_run_folder_is_left_alone(session):
    session.config.out.mkdir()
    (session.config.out / "thesis.tex").write_text("")
    session.act(PUSH)
    with pytest.raises(BadInput, match="not a sainet run folder"):
        session.act(Save())
    assert session.view.pushes == 1


def test_worlds_can_be_changed(session):
    (view,) = session.act(ChooseWorld("planar", "none", 3))
    assert (len(view.disks), view.noise, view.pushes) == (3, "none", 0)
    (moved,) = session.act(PUSH)
    assert len(moved.step.actual[0]) == 3


def test_obstacles_and_the_target_disk_are_those_of_control(tmp_path):
    disks = {"disks": 4, "moved": 2, "obstacles": 1}
    session = Session(replace(CONFIG, out=tmp_path / "play", **disks))
    assert session.view.target == 1
    trial = make_trial(ControlConfig(seed=SEED, goals="hard", **disks), 0)
    place = np.asarray(trial.robot.truth.position)
    np.testing.assert_allclose(poses(session)[:, :2], 1000 * place, atol=0.006)
    assert abs(place[3, 1]) > 0.02  # not in the row
    (view,) = session.act(ChooseWorld("planar", "none", 3))
    assert (len(view.disks), view.target) == (3, 1)
    (view,) = session.act(ChooseWorld("planar", "none", 2))
    assert (len(view.disks), view.target) == (2, 1)


@pytest.mark.parametrize(
    "wrong",
    [
        {"port": 70_000},
        {"port": -1},
        {"disks": 1},
        {"disks": 5},
        {"world": "lab", "disks": 3},
        {"obstacles": 1},
        {"moved": 3},
        {"model": ()},
        {"model": ("in", "in")},
        {"seed": -1},
        {"host": ""},
    ],
    ids=str,
)
def test_bad_settings_are_refused(wrong):
    with pytest.raises(BadSetting):
        PlayConfig(**wrong)


def test_the_virtual_lab_keeps_its_properties(session):
    pytest.importorskip("mujoco")
    (view,) = session.act(ChooseWorld("lab", "default", 2))
    assert (view.world, view.has_own_properties) == ("lab", False)
    with pytest.raises(BadMessage, match="hidden"):
        session.act(SetProperties([1.0, 1.0], [50.0, 50.0], 0.2))
