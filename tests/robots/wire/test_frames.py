"""Rigid transforms from points that were measured in two frames."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from sainet.robots.wire.frames import Rigid, fit_rigid, residuals

RNG = np.random.default_rng(0)


def transform(seed: int = 0) -> Rigid:
    rotation = Rotation.random(rng=seed).as_matrix()
    return Rigid(rotation, np.array([0.3, -1.2, 0.7]))


@pytest.mark.parametrize("flat", [1.0, 0.0])
def test_the_fit_returns_the_transform_of_exact_points(flat):
    points = RNG.normal(size=(5, 3)) * [1, 1, flat]
    found = fit_rigid(points, transform().moved(points))
    assert found is not None
    np.testing.assert_allclose(found.rotation, transform().rotation, atol=1e-12)
    np.testing.assert_allclose(found.shift, transform().shift, atol=1e-12)


def test_no_other_transform_leaves_smaller_residuals():
    points = RNG.normal(size=(6, 3))
    target = transform().moved(points) + 0.05 * RNG.normal(size=points.shape)
    found = fit_rigid(points, target)
    assert found is not None
    least = (residuals(found, points, target) ** 2).sum()
    for _ in range(50):
        turn = Rotation.from_rotvec(0.02 * RNG.normal(size=3)).as_matrix()
        shift = found.shift + 0.02 * RNG.normal(size=3)
        other = Rigid(turn @ found.rotation, shift)
        assert (residuals(other, points, target) ** 2).sum() > least
    assert np.linalg.det(found.rotation) == pytest.approx(1)


def test_points_on_a_line_fix_no_transform():
    points = np.outer(np.arange(4.0), [1, 2, 3])
    assert fit_rigid(points, points) is None


def test_transforms_compose_and_invert():
    one, other, points = transform(1), transform(2), RNG.normal(size=(4, 3))
    np.testing.assert_allclose(
        one.after(other).moved(points), one.moved(other.moved(points))
    )
    np.testing.assert_allclose(one.inverse.moved(one.moved(points)), points)


def test_turn_and_tilt_are_twist_and_swing_about_z():
    for turn in (-3.0, -0.4, 0.0, 2.5):
        for tilt in (0.0, 0.3):
            swing = Rotation.from_rotvec(tilt * np.array([0.6, 0.8, 0]))
            both = swing * Rotation.from_rotvec([0, 0, turn])
            body = Rigid(both.as_matrix(), np.zeros(3))
            assert body.turn == pytest.approx(turn)
            assert body.tilt == pytest.approx(tilt, abs=1e-7)
