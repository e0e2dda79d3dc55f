"""Drawn scenes have the paper's distributions, touch, and never overlap."""

import numpy as np
import pytest

from contracts.worlds import pushed
from sainet.datasets.config import GenerateConfig
from sainet.runs.errors import BadInput
from sainet.scenes.scene import pusher_gaps
from sainet.worlds.config import WorldConfig
from sainet.worlds.sampling import chunk_generator, draw


def drawn(pushes=400, **settings):
    return draw(WorldConfig(**settings), chunk_generator(3, 0), pushes)


def assert_uniform(values, low, high):
    assert low <= values.min() < low + 0.1 * (high - low)
    assert high - 0.1 * (high - low) < values.max() <= high
    spread = (high - low) / np.sqrt(12)
    assert values.mean() == pytest.approx((low + high) / 2, abs=0.2 * spread)
    assert values.std() == pytest.approx(spread, rel=0.15)


def test_properties_are_uniform_over_their_ranges():
    draws = drawn()
    assert_uniform(draws.mass.ravel(), 0.85, 1.15)
    assert_uniform(draws.radius.ravel(), 0.05, 0.06)
    assert_uniform(draws.table_friction, 0.05, 0.25)
    assert_uniform(draws.contact_angle, -np.pi / 3, np.pi / 3)
    assert_uniform(draws.direction, -np.pi / 6, np.pi / 6)
    np.testing.assert_allclose(draws.contact_friction, 0.25)
    np.testing.assert_allclose(draws.stroke, 0.010)
    np.testing.assert_allclose(draws.speed, 0.050)
    assert abs(np.corrcoef(draws.mass[:, 0], draws.radius[:, 0])[0, 1]) < 0.15


def test_ranges_of_strokes_are_drawn_from():
    draws = drawn(stroke_mm=(20.0, 50.0), speed_mm_s=(10.0, 20.0))
    assert_uniform(draws.stroke, 0.02, 0.05)
    assert_uniform(draws.speed, 0.01, 0.02)


def gaps(draws):
    offset = draws.position[:, :, None] - draws.position[:, None]
    reach = draws.radius[:, :, None] + draws.radius[:, None]
    gap = np.hypot(offset[..., 0], offset[..., 1]) - reach
    return np.where(np.eye(reach.shape[1], dtype=bool), np.inf, gap)


@pytest.mark.parametrize("disks", [2, 3, 4, 6])
def test_disks_touch_and_do_not_overlap(disks):
    found = gaps(drawn(disks=disks, pushes=250))
    assert found.min() > -1e-9
    np.testing.assert_allclose(found[:, 1:].min(axis=-1), 0, atol=1e-9)
    if disks == 3:
        np.testing.assert_allclose(found[:, 0, 1:], 0, atol=1e-9)


@pytest.mark.parametrize("disks", [3, 5])
def test_the_pusher_never_starts_inside_a_disk(disks):
    scene, initial, _ = pushed(GenerateConfig(disks=disks, pushes=1500), 3, 1)
    gaps = pusher_gaps(scene, initial)
    np.testing.assert_allclose(gaps[:, 0], 0, atol=1e-6)
    assert gaps[:, 1:].min() > -1e-6


def test_second_disks_are_in_front_of_the_first():
    ahead = drawn().position[:, 1]
    assert_uniform(np.arctan2(ahead[:, 1], ahead[:, 0]), -np.pi / 3, np.pi / 3)


def test_a_gap_separates_the_disks():
    np.testing.assert_allclose(gaps(drawn(gap_mm=2.0))[:, 0, 1], 0.002, atol=1e-9)


def test_disks_without_room_are_refused():
    with pytest.raises(BadInput, match="`disks` is 3: .* increase `placement_deg`"):
        drawn(disks=3, placement_deg=5.0, pushes=1)


def test_a_pusher_without_room_is_refused(monkeypatch):
    inside = np.full((1, 3), -1e-3)
    monkeypatch.setattr("sainet.worlds.sampling.pusher_gaps", lambda *_: inside)
    with pytest.raises(BadInput, match="`disks` is 3: the pusher could not be placed"):
        drawn(disks=3, pushes=1)


def test_each_chunk_has_its_own_draws():
    one, again, other, seed = (
        chunk_generator(*key).random() for key in ((0, 0), (0, 0), (0, 1), (1, 0))
    )
    assert one == again
    assert len({one, other, seed}) == 3


@pytest.mark.parametrize("disks", [3, 5])
def test_disks_of_a_row_touch_the_one_before(disks):
    found = gaps(drawn(disks=disks, arrangement="row", pushes=100))
    assert np.abs(found[:, range(disks - 1), range(1, disks)]).max() < 1e-6
    assert (
        found[:, np.triu_indices(disks, 2)[0], np.triu_indices(disks, 2)[1]].min() > 0
    )


@pytest.mark.parametrize("disks", [3, 8])
def test_disks_of_a_triangle_touch_two_others(disks):
    found = gaps(drawn(disks=disks, arrangement="triangle", pushes=100))
    touched = (np.abs(found) < 2e-6).sum(axis=(1, 2))
    assert (touched >= 2 * (2 * disks - 3)).all()  # each contact in both triangles


def test_a_negative_gap_is_an_overlap():
    found = gaps(drawn(gap_mm=-2.0, pushes=50))
    np.testing.assert_allclose(found[:, 0, 1], -0.002, atol=1e-6)
