import msgspec
import numpy as np
import pytest

from sainet.robots.wire.arm import DryArm
from sainet.robots.wire.limits import CYCLE, Limits, Stopped
from sainet.runs.errors import BadInput

LIMITS = Limits(low=(0.0, 0.0, 0.0), high=(1.0, 1.0, 1.0), speed=0.1, line=0.002)
MIDDLE = np.array([0.5, 0.5, 0.5])
STEP = 0.1 * CYCLE


def ahead(*steps: float) -> np.ndarray:
    """Rows at these distances (cycles at the speed limit) ahead of the middle."""
    return MIDDLE + STEP * np.outer(steps, [1.0, 0.0, 0.0])


def test_rows_are_the_path_and_its_end_held():
    path = ahead(0, 1, 2, 2.5)
    rows = LIMITS.rows(MIDDLE, path)
    np.testing.assert_array_equal(rows[:4], path)
    np.testing.assert_array_equal(rows[4:], [path[-1]] * LIMITS.lag_cycles)
    assert (LIMITS.lag_cycles - 1) * CYCLE < LIMITS.lag <= LIMITS.lag_cycles * CYCLE


def test_rows_lead_from_an_arm_that_is_near_to_the_path():
    path = ahead(3.5, 4.5)
    rows = LIMITS.rows(MIDDLE, path)
    np.testing.assert_array_equal(rows[0], MIDDLE)
    steps = np.linalg.norm(np.diff(rows, axis=0), axis=1)
    assert (steps <= STEP * (1 + 1e-9)).all()
    np.testing.assert_array_equal(rows[4:6], path)


@pytest.mark.parametrize(
    ("path", "why"),
    [
        (ahead(0, 1, 2.1), "row 2 of the path is 0.444 mm from the row before"),
        (ahead(6), "starts 2.4 mm from the arm"),
        (np.array([[1.1, 0.5, 0.5]]), "row 0 of the path"),
        (np.array([MIDDLE, [0.5, 0.5, -1e-9]]), "row 1 of the path"),
        (np.array([MIDDLE, [0.5, np.nan, 0.5]]), "outside the workspace"),
        (np.array([[np.inf, 0.5, 0.5]]), "outside the workspace"),
        (np.zeros((0, 3)), "empty"),
    ],
)
def test_refused_paths(path: np.ndarray, why: str):
    with pytest.raises(Stopped, match=why):
        LIMITS.rows(MIDDLE, path)


@pytest.mark.parametrize("start", [[0.5, 0.5, -0.001], [np.nan, 0.5, 0.5]])
def test_an_arm_outside_the_workspace(start: list[float]):
    with pytest.raises(Stopped, match="the arm, at .* is outside the workspace"):
        LIMITS.rows(np.array(start), ahead(0))


def test_an_arm_that_rests_on_the_border_may_start():
    start = np.array([0.5, 0.5, -0.0001])
    rows = LIMITS.rows(start, np.array([[0.5, 0.5, 0.0003]]))
    assert (rows[:, 2] >= 0).all()


@pytest.mark.parametrize(
    "change",
    [
        {"speed": 0.0},
        {"speed": 100.0},
        {"line": 1.0},
        {"lag": 30.0},
        {"age": 1.0},
        {"low": [0, 0, -400]},
        {"low": [0, 0, 1.0]},
        {"low": [0, 0]},
        {"sped": 0.1},
    ],
)
def test_bad_limits_in_a_document(change: dict[str, object]):
    good = msgspec.to_builtins(LIMITS)
    assert msgspec.convert(good, Limits) == LIMITS
    with pytest.raises(msgspec.ValidationError):
        msgspec.convert(good | change, Limits)


def test_reversed_limits_name_the_axis():
    with pytest.raises(BadInput, match="low y is 2 m and high y is 1 m"):
        Limits(low=(0.0, 2.0, 0.0), high=(1.0, 1.0, 1.0), speed=0.1, line=0.002)


def test_arms_check_the_range_of_limits():
    wild = Limits(low=(0.0, 0.0, 0.0), high=(1.0, 1.0, 1.0), speed=50.0, line=0.002)
    with pytest.raises(BadInput, match="speed"):
        DryArm(MIDDLE, wild, lambda time, position: None)


def test_a_rehearsal_shows_every_command():
    shown: list[tuple[float, np.ndarray]] = []
    path = ahead(0, 1, 2)
    with DryArm(MIDDLE, LIMITS, lambda *each: shown.append(each)) as arm:
        stroke = arm.follow(path)
        np.testing.assert_array_equal(arm.position(), path[-1])
        refused = arm.follow(np.zeros((1, 3)))
    assert not stroke.trouble
    np.testing.assert_array_equal([time for time, _ in shown], stroke.time)
    np.testing.assert_array_equal([row for _, row in shown], stroke.commanded)
    np.testing.assert_array_equal(stroke.measured, stroke.commanded)
    np.testing.assert_allclose(np.diff(stroke.time), CYCLE)
    assert "refused" in refused.trouble and len(refused.time) == 0
