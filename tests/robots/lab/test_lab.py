"""The virtual lab: MuJoCo agrees with the planar engine where nothing is hidden."""

from dataclasses import fields, replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from sainet.engines import make_engine
from sainet.engines.base import roll_out
from sainet.engines.simulator import PAPER_RADIUS
from sainet.robots import SURFACES
from sainet.robots.lab.hidden import (
    LABS,
    RANGES,
    Disk,
    Field,
    Lab,
    Table,
    draw_lab,
)
from sainet.robots.lab.mechanics import TICK, Mechanics
from sainet.robots.lab.robot import LabRobot
from sainet.runs.errors import BadScene
from sainet.scenes.pushes import Push, command_path
from sainet.scenes.state import State, at_rest, in_a_row

FLAT = Field(np.zeros((1, 2)), np.zeros(1), 0.0)
# As close as planar engine and Bullet are to each other in the studies.
PARITY = (6e-4, np.deg2rad(1))  # m, rad
TOUCHING = in_a_row(np.array(PAPER_RADIUS))


def push(contact=0.3, direction=-0.2, length=0.01, speed=0.05):
    return Push(*(jnp.float32(x) for x in (contact, direction, length, speed)))


def ideal(lab: Lab) -> Lab:
    """Return the lab with an even table, round disks, and a tracker without errors."""
    angle = 2 * np.pi / 12 * np.arange(12)
    ring = np.stack([np.cos(angle), np.sin(angle)], -1) * 2 / 3
    disks = tuple(
        Disk(d.mass, d.radius, d.radius * ring, np.zeros((2, 1))) for d in lab.disks
    )
    capture = replace(
        lab.capture,
        offset=np.zeros(2),
        distortion=(FLAT, FLAT),
        noise=0.0,
        noise_angle=0.0,
    )
    return replace(
        lab,
        table=Table(0.15, FLAT, 0.0, 0.0),
        disks=disks,
        pusher_friction=0.25,
        push_variation=0.0,
        disk_friction=0.25,
        arm=replace(lab.arm, frequency=100.0, delay=0.0, error=0.0),
        capture=capture,
    )


def poses(state: State) -> np.ndarray:
    return np.concatenate([state.position, state.angle[..., None]], -1)


@pytest.mark.parametrize("direction", [-0.5, 0.0, 0.3])
def test_one_disk_in_a_lab_that_hides_nothing_moves_as_in_the_planar_engine(direction):
    off = away_from_planar_engine(1, push(0.4, direction, speed=0.02))
    assert np.linalg.norm(off[0, :2]) < PARITY[0]
    assert abs(off[0, 2]) < PARITY[1]


def test_two_disks_move_as_in_the_planar_engine_where_they_do_not_buckle():
    # Elsewhere two engines are a millimetre apart, planar and Bullet as well.
    off = away_from_planar_engine(2, push(0.0, 0.0, speed=0.01))
    assert np.linalg.norm(off[:, :2], axis=-1).max() < PARITY[0]
    assert np.abs(off[:, 2]).max() < PARITY[1]


def away_from_planar_engine(disks: int, one: Push) -> np.ndarray:
    """Return final poses in a lab that hides nothing minus those of the engine."""
    lab = ideal(draw_lab(0, "abs", order=tuple(range(disks))))
    made = LabRobot(lab, in_a_row(np.array([d.radius for d in lab.disks])))
    made._pose = poses(in_a_row(np.array([d.radius for d in lab.disks])))
    seen = made.observe()
    made.push(one)
    scene, start, command = jax.tree.map(
        lambda x: jnp.asarray(x)[None], (made.scene, seen, one)
    )
    steps = int((0.4 + float(one.length / one.speed)) / made.scene.time_step)
    initial, controls = command_path(scene, start, command, steps=steps)
    end = roll_out(make_engine("planar"), scene, initial, controls).states
    moved = poses(made.truth) - poses(seen)
    assert np.linalg.norm(moved[0, :2]) > 0.004
    return poses(made.truth) - poses(jax.tree.map(lambda x: x[0, -1], end))


def test_disks_are_at_rest_when_a_recording_ends_and_do_not_creep():
    mechanics = Mechanics(draw_lab(1, "plywood"))
    pose = poses(TOUCHING)[None]
    beside = np.full((1, round(1 / TICK), 2), -0.5)
    motion = mechanics.run(pose, beside, np.ones(1))
    assert np.ptp(motion.pose[0, 50:], axis=0).max() < 1e-6
    assert motion.tilt.max() < 1e-3


@pytest.mark.parametrize("turned", [np.pi + 0.5, -7.0])
def test_angles_go_on_from_those_before_a_push(turned):
    made = LabRobot(draw_lab(0, "abs"), TOUCHING)
    made._pose[:, 2] = turned
    made.observe()
    made.push(push())
    assert np.abs(made._pose[:, 2] - turned).max() < 0.5


def test_several_pushes_at_once_equal_single_pushes():
    lab, rng = draw_lab(2, "abs"), np.random.default_rng(0)
    pose = np.repeat(poses(TOUCHING)[None], 3, 0)
    start = pose[:, 0, :2] - [0.0525 + 0.0048, 0] + rng.normal(0, 1e-4, (3, 2))
    path = start[:, None] + np.linspace(0, 0.01, 60)[:, None] * np.array([1.0, 0.1])
    friction = np.array([0.2, 0.4, 0.6])
    together = Mechanics(lab, 3).run(pose, path, friction).pose
    one = Mechanics(lab)
    for i in range(3):
        alone = one.run(pose[i : i + 1], path[i : i + 1], friction[i : i + 1]).pose
        np.testing.assert_array_equal(alone[0], together[i])


def test_equal_seeds_give_equal_recordings_and_a_finished_push_moves_both_disks():
    def record(seed):
        made = LabRobot(draw_lab(0, "abs"), TOUCHING, seed=seed)
        made.observe()
        return made.push(push())

    first, again, other = record(3), record(3), record(4)
    np.testing.assert_array_equal(first.pose, again.pose)
    np.testing.assert_array_equal(first.pusher, again.pusher)
    assert first.pose.shape != other.pose.shape or (first.pose != other.pose).any()
    assert first.trouble == ""
    seen = first.pose[np.isfinite(first.pose[:, 0, 0])]
    assert np.linalg.norm(seen[-1, :, :2] - seen[0, :, :2], axis=-1).min() > 0.004
    tip = first.pusher[np.isfinite(first.pusher[:, 0])]
    assert np.linalg.norm(tip[-1] - tip[0]) == pytest.approx(0.01, abs=2e-4)
    assert (first.time[0], len(np.unique(first.time))) == (0, len(first.time))


def test_observations_scatter_about_the_truth():
    made = LabRobot(draw_lab(0, "abs"), TOUCHING)
    seen = np.array([made.observe().position for _ in range(200)])
    low, high = np.array(RANGES["abs"].capture_noise) / np.sqrt(10)
    assert low * 0.8 < seen.std(axis=0).mean() < high * 1.2
    assert np.abs(seen.mean(axis=0) - made.truth.position).max() < 3e-5


def test_the_frames_of_robot_and_tracker_are_inverse_to_each_other():
    capture = draw_lab(3, "abs").capture
    pose = np.random.default_rng(0).uniform(-0.2, 0.2, (50, 3))
    np.testing.assert_allclose(capture.unseen(capture.seen(pose)), pose, atol=1e-7)
    away = np.linalg.norm((capture.seen(pose) - pose)[:, :2], axis=1)
    assert 1e-5 < away.mean() < 3e-3


def test_people_put_touching_disks_together_and_never_into_each_other():
    made = LabRobot(draw_lab(0, "abs"), TOUCHING)
    radii = np.asarray(made.scene.radius, float)
    for _ in range(50):
        made.arrange(TOUCHING)
        place = np.asarray(made.truth.position, float)
        # The tracker's frame is distorted: by less than a percent.
        gap = np.linalg.norm(place[1] - place[0]) - radii.sum()
        assert -1e-6 < gap < 2.5e-4
    far = at_rest(
        jnp.array([[0.0, 0.0], [0.2, 0.0]]), jnp.zeros(2), jnp.zeros(2, jnp.float32)
    )
    made.arrange(far)
    assert np.abs(made.truth.position - far.position).max() < 5e-3


def test_disks_that_are_where_they_are_wanted_stay_while_another_one_is_dragged():
    made = LabRobot(draw_lab(0, "abs"), TOUCHING)
    before = poses(made.truth)
    for step in range(50):
        place = made.truth.position.at[1].set(jnp.array([0.2 + 0.001 * step, 0.05]))
        made.arrange(at_rest(place, made.truth.angle, jnp.zeros(2, jnp.float32)))
    after = poses(made.truth)
    np.testing.assert_allclose(after[0], before[0], atol=1e-5)
    np.testing.assert_allclose(after[1, :2], [0.249, 0.05], atol=3e-3)


def test_a_push_begins_from_an_observation_of_its_own_if_there_is_none():
    made = LabRobot(draw_lab(0, "abs"), TOUCHING)
    place = TOUCHING.position
    for offset in (0.0, 0.3):
        moved = at_rest(place + offset, TOUCHING.angle, TOUCHING.pusher_position)
        made.arrange(moved)
        before = poses(made.truth)
        assert made.push(push()).trouble == ""
        assert np.linalg.norm((poses(made.truth) - before)[0, :2]) > 5e-3


@pytest.mark.parametrize(("name", "value"), [("length", np.nan), ("speed", 0.0)])
def test_a_push_out_of_range_is_refused_and_moves_nothing(name, value):
    made = LabRobot(draw_lab(0, "abs"), TOUCHING)
    before = poses(made.truth)
    with pytest.raises(BadScene, match=f"push: {name} is {value:g}"):
        made.push(push(**{name: value}))
    np.testing.assert_array_equal(poses(made.truth), before)


def test_a_push_that_begins_on_another_disk_is_refused():
    made = LabRobot(draw_lab(0, "abs"), TOUCHING)
    made.observe()
    before = poses(made.truth)
    found = made.push(push(contact=np.pi))
    assert found.trouble == "the pusher would descend on disk 2"
    np.testing.assert_array_equal(poses(made.truth), before)


@pytest.mark.parametrize("surface", SURFACES)
def test_hidden_parameters_are_within_the_ranges(surface):
    ranges = RANGES[surface]
    for number in range(LABS):
        lab = draw_lab(number, surface)
        found = {
            "friction": lab.table.friction,
            "anisotropy": lab.table.anisotropy,
            "variation": lab.table.variation.deviation,
            "pusher_friction": lab.pusher_friction,
            "push_variation": lab.push_variation,
            "disk_friction": lab.disk_friction,
            "arm_frequency": lab.arm.frequency,
            "arm_delay": lab.arm.delay,
            "arm_error": lab.arm.error,
            "capture_noise": lab.capture.noise,
            "capture_noise_angle": lab.capture.noise_angle,
            "capture_rate": lab.capture.rate,
            "capture_delay": lab.capture.delay,
        }
        for name, value in found.items():
            low, high = getattr(ranges, name)
            assert low <= value <= high, name
        for disk in lab.disks:
            assert ranges.feet[0] <= len(disk.feet) <= ranges.feet[1]
            turn = np.linspace(-np.pi, np.pi, 721)[:-1]
            rim = np.array([disk.rim_friction(side) for side in turn])
            assert rim.mean() == pytest.approx(1, abs=0.15)
            assert np.log(rim).std() < 1.0


def test_labs_differ_and_surfaces_share_everything_else():
    smooth, rough, other = (
        draw_lab(0, "abs"),
        draw_lab(0, "plywood"),
        draw_lab(1, "abs"),
    )
    assert smooth.pusher_friction == rough.pusher_friction != other.pusher_friction
    assert smooth.table.friction < rough.table.friction
    np.testing.assert_array_equal(smooth.disks[0].feet, rough.disks[0].feet)
    swapped = draw_lab(0, "abs", order=(1, 0))
    for disk, same in zip(swapped.disks, reversed(smooth.disks), strict=True):
        for each in fields(Disk):
            np.testing.assert_array_equal(
                getattr(disk, each.name), getattr(same, each.name)
            )


def test_friction_depends_on_place_and_direction():
    table = draw_lab(0, "plywood").table
    along = np.array([np.cos(table.grain), np.sin(table.grain)])
    across = np.array([-along[1], along[0]])
    place = np.random.default_rng(0).uniform(-0.1, 0.1, (4000, 2))
    ahead, beside = (
        table.friction_at(place, np.broadcast_to(way, place.shape))
        for way in (along, across)
    )
    wanted = (1 + table.anisotropy) / (1 - table.anisotropy)
    np.testing.assert_allclose(np.median(ahead / beside), wanted, rtol=1e-6)
    assert ahead.std() / ahead.mean() == pytest.approx(
        table.variation.deviation, rel=0.5
    )
