"""Obstacles: beside the way, clear of every disk, and the same for every model."""

import numpy as np
import pytest

from sainet.control.config import ControlConfig
from sainet.control.trial import make_trial
from sainet.runs.errors import BadInput, BadSetting
from sainet.scenes.state import in_a_row
from sainet.tasks.obstacles import Way, draw_obstacles

RADIUS = np.array([0.054, 0.059, 0.05, 0.056])
ROW = np.array([[0.0, 0.0], [0.113, 0.0]])
WAY = Way(1, ROW[1] + 0.177 * np.array([np.cos(0.5), np.sin(0.5)]))


def gap_to_way(place: np.ndarray, radius: float) -> float:
    """The least gap to the target disk at a thousand places of its way (m)."""
    share = np.linspace(0, 1, 1000)[:, None]
    path = ROW[1] + share * (WAY.goal - ROW[1])
    return float(np.linalg.norm(path - place, axis=1).min() - RADIUS[1] - radius)


@pytest.mark.parametrize("trial", range(20))
def test_obstacles_lie_beside_the_way_and_touch_nothing(trial):
    found = draw_obstacles(3, trial, WAY, ROW, RADIUS)
    assert found.shape == (2, 2)
    gaps = [gap_to_way(p, r) for p, r in zip(found, RADIUS[2:], strict=True)]
    assert min(gaps) >= 0.002 - 1e-6 and max(gaps) <= 0.03 + 1e-6
    every = np.concatenate([ROW, found])
    apart = np.linalg.norm(every[:, None] - every, axis=-1)
    clear = apart - RADIUS[:, None] - RADIUS
    assert clear[2:, :2].min() >= 0.002 and clear[2, 3] >= 0.002
    np.testing.assert_array_equal(found, draw_obstacles(3, trial, WAY, ROW, RADIUS))
    assert not np.allclose(found, draw_obstacles(4, trial, WAY, ROW, RADIUS))


def test_obstacles_that_leave_no_room_for_the_last_are_drawn_again():
    radius = np.append(RADIUS, 0.055)
    way = Way(1, ROW[1] + [0.177, 0.0])
    for trial in range(60):
        found = np.concatenate([ROW, draw_obstacles(0, trial, way, ROW, radius)])
        apart = np.linalg.norm(found[:, None] - found, axis=-1) - radius[:, None]
        assert (apart - radius)[2:, :2].min() >= 0.002


def test_too_many_obstacles_are_refused():
    with pytest.raises(BadInput, match="`obstacles` is 20: they have no room"):
        draw_obstacles(0, 0, WAY, ROW, np.full(22, 0.059))


def test_a_trial_has_its_obstacles_beside_the_row():
    config = ControlConfig(model="physics", disks=4, obstacles=2, goals="hard")
    trial = make_trial(config, 1)
    state, task = trial.robot.truth, trial.task
    assert task.moved == 1
    free = make_trial(ControlConfig(model="physics", goals="hard"), 1)
    np.testing.assert_allclose(task.goal, free.task.goal, atol=1e-6)
    np.testing.assert_allclose(state.position[:2], free.robot.truth.position, atol=1e-6)
    row = in_a_row(np.asarray(trial.robot.scene.radius)).position
    assert np.linalg.norm(state.position - row, axis=-1)[2:].min() > 0.01
    seen = np.asarray(trial.robot.observe().position)
    assert np.abs(seen - np.asarray(state.position)).max() < 2e-3


def test_another_disk_of_the_row_can_be_the_target():
    trial = make_trial(ControlConfig(model="physics", disks=3, moved=2), 0)
    assert trial.task.moved == 1
    away = np.asarray(trial.task.goal) - np.asarray(trial.robot.truth.position)[1]
    radius = float(trial.scene.radius[1])
    assert np.linalg.norm(away) == pytest.approx(3 * radius, rel=1e-5)


@pytest.mark.parametrize(
    ("settings", "says"),
    [
        ({"moved": 0}, "moved"),
        ({"moved": 3}, "moved"),
        ({"disks": 4, "obstacles": 2, "moved": 3}, "moved"),
        ({"obstacles": -1}, "obstacles"),
        ({"obstacles": 1}, "obstacles"),
        ({"disks": 4, "obstacles": 3}, "obstacles"),
        ({"robot": "lab", "obstacles": 1}, "obstacles"),
    ],
)
def test_settings_that_leave_no_row_are_refused(settings, says):
    with pytest.raises(BadSetting, match=says):
        ControlConfig(**settings)
