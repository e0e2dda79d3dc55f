"""A surface that changes: the disks stay where they were left, friction does not."""

from dataclasses import replace
from importlib.util import find_spec

import jax
import numpy as np
import pytest

from sainet.control.config import ControlConfig
from sainet.control.trial import make_trial
from sainet.runs.errors import BadSetting
from sainet.scenes.pushes import PushGrid
from support import require

PUSHES = PushGrid().pushes()
SIMULATED = ControlConfig(noise_level="none")
LAB = ControlConfig(robot="lab", lab=1)


def some(config, after, count=3):
    """The robot of a trial after some pushes, and what was recorded."""
    robot = make_trial(replace(config, new_surface_after=after), 0).robot
    recordings, left = [], []
    for number in range(count):
        robot.observe()
        recordings.append(
            robot.push(jax.tree.map(lambda x, n=number: x[30 + n], PUSHES))
        )
        left.append(robot.truth)
    return robot, recordings, left


@pytest.fixture(params=[SIMULATED, LAB], ids=["simulated", "lab"])
def config(request):
    if request.param.robot == "lab":
        require(find_spec("mujoco"), "MuJoCo is not installed")
    return request.param


def test_the_first_pushes_are_as_ever_and_the_next_are_not(config):
    _, usual, left = some(config, None)
    _, found, later = some(config, 2)
    for mine, other in zip(found[:2], usual[:2], strict=True):
        np.testing.assert_array_equal(mine.pose, other.pose)
    for mine, other in zip(later[:2], left[:2], strict=True):
        # A change of frames and back in single precision.
        np.testing.assert_allclose(mine.position, other.position, atol=1e-6)
        np.testing.assert_allclose(mine.angle, other.angle, atol=1e-6)
    assert np.abs(later[2].position - left[2].position).max() > 1e-5


def test_equal_seeds_give_equal_pushes_on_the_new_surface(config):
    (_, one, _), (_, other, _) = some(config, 1), some(config, 1)
    np.testing.assert_array_equal(one[-1].pose, other[-1].pose)


def test_recordings_name_the_surface_they_were_made_on():
    require(find_spec("mujoco"), "MuJoCo is not installed")
    for before, after in (("abs", "plywood"), ("plywood", "abs")):
        _, found, _ = some(replace(LAB, surface=before), 1, 2)
        assert [each.conditions.surface for each in found] == [before, after]


def test_a_simulated_table_has_another_friction():
    robot, _, _ = some(SIMULATED, None, 1)
    changed, _, _ = some(SIMULATED, 1, 1)
    one, other = (float(each.scene.table_friction) for each in (robot, changed))
    assert abs(one - other) > 1e-3
    np.testing.assert_array_equal(robot.scene.mass, changed.scene.mass)


def test_bad_changes_are_refused(tmp_path):
    with pytest.raises(BadSetting, match="new_surface_after"):
        ControlConfig(new_surface_after=0)
    cell = tmp_path / "cell.toml"
    with pytest.raises(BadSetting, match="exchange its surface by hand"):
        ControlConfig(robot="abb", config=cell, new_surface_after=3)
    with pytest.raises(BadSetting, match="below `pushes`"):
        ControlConfig(pushes=5, new_surface_after=5).check_used()
