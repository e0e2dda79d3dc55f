"""The robot of the simulated world: as exact as its noise lets it be."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from planning.scenes import scene, touching
from sainet.engines import make_engine
from sainet.models.dynamics import PhysicsDynamics
from sainet.planning.levels import roll_pushes
from sainet.robots.simulated import SimulatedRobot
from sainet.runs.errors import BadScene
from sainet.scenes.pushes import PushGrid
from sainet.scenes.state import at_rest
from sainet.worlds.noise import NoiseConfig, at_level
from sainet.worlds.setups import RobotSetup
from sainet.worlds.world import SimulatedWorld

QUIET = at_level(NoiseConfig(), "none")
PUSH = jax.tree.map(lambda x: x[33], PushGrid().pushes())


def robot(noise=QUIET, seed=0):
    engine, rng = make_engine("planar"), np.random.default_rng(seed)
    world = SimulatedWorld(engine, RobotSetup(), noise, rng, np.float32)
    return SimulatedRobot(world, scene(), touching())


def test_without_noise_the_robot_equals_the_engine():
    made = robot()
    seen = made.observe()
    found = made.push(PUSH)
    batch = jax.tree.map(lambda x: x[None], (scene(), seen, PUSH))
    wanted = roll_pushes(PhysicsDynamics(make_engine("planar")), *batch, 80).states
    position = np.asarray(wanted.position[0])
    np.testing.assert_allclose(found.pose[1:81, :, :2], position, atol=1e-5)
    np.testing.assert_allclose(made.truth.position, found.pose[-1, :, :2])
    np.testing.assert_array_equal(found.pose[0, :, :2], touching().position)
    np.testing.assert_allclose(np.diff(found.time), 1 / 240)
    assert (found.commanded, found.trouble) == (PUSH, "")
    assert not np.asarray(made.observe().velocity).any()


def test_measured_poses_are_noisy_and_the_truth_is_not():
    made = robot(NoiseConfig())
    seen = np.array([made.observe().position for _ in range(300)])
    np.testing.assert_array_equal(made.truth.position, touching().position)
    assert seen.std(axis=0) == pytest.approx(1.5e-4, rel=0.2)
    assert np.abs(seen.mean(axis=0) - made.truth.position).max() < 4e-5


def test_equal_seeds_give_equal_worlds():
    def end(seed):
        made = robot(NoiseConfig(), seed)
        made.observe()
        return made.push(PUSH).pose[-1]

    np.testing.assert_array_equal(end(3), end(3))
    assert np.abs(end(3) - end(4)).max() > 1e-5


def test_a_push_that_moves_nothing_is_reported():
    made = robot()
    made.observe()
    short = eqx.tree_at(lambda p: (p.length, p.speed), PUSH, (jnp.float32(1e-4),) * 2)
    assert made.push(short).trouble == "disk 1 did not move"


@pytest.mark.parametrize(("name", "value"), [("length", np.nan), ("speed", 0.0)])
def test_a_push_out_of_range_is_refused_and_moves_nothing(name, value):
    made = robot()
    before = made.observe()
    bad = eqx.tree_at(lambda p: getattr(p, name), PUSH, jnp.float32(value))
    with pytest.raises(BadScene, match=f"push: {name} is {value:g}"):
        made.push(bad)
    np.testing.assert_array_equal(made.truth.position, before.position)


def test_a_push_begins_where_the_disks_were_arranged():
    made = robot()
    seen = made.observe()
    place = seen.position + 0.3
    made.arrange(at_rest(place, seen.angle, seen.pusher_position))
    assert made.push(PUSH).trouble == ""
    assert np.linalg.norm(made.truth.position[0] - place[0]) > 5e-3


def test_a_push_that_starts_inside_a_disk_is_reported():
    made = robot()
    made.observe()
    backwards = eqx.tree_at(lambda p: p.contact_angle, PUSH, jnp.float32(np.pi))
    trouble = made.push(backwards).trouble
    assert trouble == "the pusher began 9.6 mm inside disk 2"


def test_disks_lie_at_rest_where_they_are_arranged():
    made, wanted = robot(), touching()
    made.observe()
    made.push(PUSH)
    made.arrange(eqx.tree_at(lambda s: s.spin, wanted, wanted.spin + 1))
    assert eqx.tree_equal(made.truth, wanted)
    np.testing.assert_array_equal(made.observe().position, wanted.position)
