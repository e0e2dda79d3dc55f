"""Engines from MJCF files: MuJoCo pushes as physics, and as the planar engine does."""

import sys

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import sainet as sn
from contracts.worlds import make_scene
from sainet.datasets.batch import from_trajectory, to_controls, to_initial, to_scene
from sainet.datasets.store import open_store
from sainet.datasets.writer import write_store
from sainet.engines.planar.engine import PlanarEngine
from sainet.engines.simulator import OWN
from sainet.models.dynamics import PhysicsDynamics, predict
from sainet.runs.errors import BadInput, MissingExtra, UnknownName
from sainet.scenes.pushes import command_force, command_path
from sainet.tasks.push_to_goal import PushToGoal
from support import REPOSITORY

pytest.importorskip("mujoco")

PUCKS = REPOSITORY / "examples" / "pucks.xml"
SCENE = sn.Scene.disks(mass=[0.9, 1.0], radius=[0.054, 0.059])
STEPS = 120
SLIDES = "".join(
    f'      <joint type="slide" axis="{axis}"/>\n'
    for axis in ("1 0 0", "0 1 0", "0 0 1")
)
JOINTS = SLIDES + '      <joint type="hinge" axis="0 0 1"/>\n'


@pytest.fixture(scope="module")
def pucks() -> sn.Model:
    return sn.from_mjcf(PUCKS)


@pytest.fixture
def edited(tmp_path):
    """Return the path of a file with another text in place of one of `PUCKS`."""

    def edit(old: str, new: str, count: int = -1):
        text = PUCKS.read_text("utf-8")
        assert old in text
        path = tmp_path / "edited.xml"
        path.write_text(text.replace(old, new, count), "utf-8")
        return path

    return edit


def apart() -> sn.State:
    """Disks at rest, 300 mm apart."""
    row = SCENE.in_a_row()
    return eqx.tree_at(lambda s: s.position, row, row.position.at[1, 0].set(0.3))


def final(model: sn.Model, start=None, *, steps=STEPS, **push) -> np.ndarray:
    """Poses [push, body, 3] in mm and rad after pushes; contacts at three angles."""
    angles = push or {"contact_angle": jnp.array([-0.3, 0.0, 0.3])}
    state = model.predict(
        SCENE,
        SCENE.in_a_row() if start is None else start,
        sn.Push(**angles),
        steps=steps,
    ).final
    return np.concatenate([1e3 * state.position, state.angle[..., None]], axis=-1)


def test_a_centred_push_carries_a_disk_and_leaves_the_other(pucks):
    found = final(pucks, apart(), contact_angle=jnp.zeros(1))[0]
    # The push is 10 mm; afterwards the disk slides by v^2 / (2 mu g) = 0.85 mm.
    assert found[0, 0] == pytest.approx(10.0, abs=1.0)
    np.testing.assert_allclose(found[0, 1:], 0.0, atol=1e-4)
    np.testing.assert_allclose(found[1], [300.0, 0.0, 0.0], atol=1e-4)


def test_a_disk_at_a_distance_stays(pucks):
    at = pucks.predict(SCENE, apart(), sn.Push(jnp.array([0.4])), steps=STEPS).states
    still = np.abs(np.asarray(at.position)[..., 1, :] - [np.float32(0.3), 0.0])
    assert still.max() < 1e-7
    assert np.abs(np.asarray(at.angle)[..., 1]).max() < 1e-9


def test_a_push_in_a_row_moves_both_disks(pucks):
    one, two = final(pucks, contact_angle=jnp.zeros(1))[0]
    assert one[0] > 9.5
    assert two[0] - 113.0 == pytest.approx(one[0], abs=0.5)


@pytest.mark.parametrize("joints", [JOINTS, "      <freejoint/>\n"])
def test_mirrored_pushes_move_disks_mirrored(edited, joints):
    left, centre, right = final(sn.from_mjcf(edited(JOINTS, joints)))
    np.testing.assert_allclose(left * [1, -1, -1], right, atol=1e-3)
    np.testing.assert_allclose(centre[:, 1:], 0.0, atol=1e-3)


def test_another_body_may_come_before_the_disks(pucks, edited):
    box = '<body pos="0.5 0.5 0.02"><freejoint/><geom type="box" size=".02 .02 .02"/>'
    first = '<body name="disk1"'
    found = final(sn.from_mjcf(edited(first, f"{box}</body>{first}")))
    np.testing.assert_allclose(found, final(pucks), atol=1e-3)


def test_it_pushes_as_the_planar_engine(pucks):
    identity = sn.load("physics").id
    engine = sn.Model(identity, PhysicsDynamics(PlanarEngine()))
    found, expected = final(pucks), final(engine)
    np.testing.assert_allclose(found[..., :2], expected[..., :2], atol=0.3)  # mm
    np.testing.assert_allclose(found[..., 2], expected[..., 2], atol=0.015)  # rad


def test_velocities_fit_the_poses_and_two_rollouts_equal_one(pucks):
    dynamics = pucks.dynamics
    scene, rest = jax.tree.map(lambda x: x[None], (SCENE, SCENE.in_a_row()))
    initial, controls = command_path(scene, rest, sn.Push(jnp.array([0.3])), steps=60)
    whole = predict(dynamics, scene, initial, controls).states
    moved = np.diff(whole.position, axis=1) / SCENE.time_step
    np.testing.assert_allclose(whole.velocity[:, 1:], moved, atol=1e-4)
    carry, found = dynamics.begin(scene, initial), []
    for part in (slice(25), slice(25, None)):
        some = jax.tree.map(lambda x, p=part: x[:, p], controls)
        carry, trajectory = dynamics.advance(scene, carry, some)
        found.append(trajectory.states.position)
    joined = np.concatenate(found, axis=1)
    np.testing.assert_allclose(
        joined, whole.position, atol=5e-5
    )  # m: speeds within a step are lost


def test_a_disk_slides_as_far_as_friction_lets_it(pucks):
    start = eqx.tree_at(
        lambda s: (s.velocity, s.pusher_position),
        apart(),
        (jnp.array([[0.0, 0.1], [0.0, 0.0]]), jnp.array([-0.2, 0.0])),
    )
    still = sn.PathControls(
        jnp.tile(start.pusher_position, (60, 1)), jnp.zeros((60, 2))
    )
    way = predict(pucks.dynamics, SCENE, start, still).final.position[0, 1]
    assert float(way) == pytest.approx(0.1**2 / (2 * 0.15 * 9.81), rel=0.03)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('mocap="true"', "", "no mocap body 'pusher'"),
        ('name="disk1"', 'name="disk3"', "no body 'disk1'; use disk1"),
        ('name="disk2"', 'name="disk3"', "no body 'disk2'; use disk1"),
        (SLIDES, "", "joints of 'disk1' do not fit; give it a freejoint"),
        ('type="cylinder" size="0.055', 'type="box" size="0.1 0.1', "no cylinder in"),
        ('name="disk1"', 'name="disk1" euler="0 0 9"', "'disk1' is rotated"),
        ("<mujoco", "<mujoca", r"MuJoCo refuses it \(.*\); correct it"),
        ("</mujoco>", "", r"MuJoCo refuses it \(XML parse error"),
    ],
)
def test_a_file_that_does_not_fit_is_refused(edited, old, new, message):
    with pytest.raises(BadInput, match=rf"edited\.xml: {message}") as caught:
        sn.from_mjcf(edited(old, new))
    assert "\n" not in str(caught.value)


def test_other_input_is_refused(pucks, tmp_path, monkeypatch):
    with pytest.raises(BadInput, match=r"none\.xml: no such file; give the path"):
        sn.from_mjcf(tmp_path / "none.xml")
    with pytest.raises(BadInput, match="name"):
        sn.from_mjcf(PUCKS, name="../x")
    one = sn.Scene.disks(mass=[0.9], radius=[0.05])
    with pytest.raises(
        BadInput, match="it has 2 disks, the scene 1; give both as many"
    ):
        pucks.predict(one, one.in_a_row(), sn.Push(0.0), steps=9)
    scene = make_scene(np.ones((1, 2)), np.full((1, 2), 0.05))
    rest = jax.tree.map(lambda x: x[None], SCENE.in_a_row())
    push = command_force(scene, rest, sn.Push(jnp.zeros(1)), force=8.0, steps=9)
    with pytest.raises(BadInput, match="take pushers that follow a path"):
        predict(pucks.dynamics, scene, *push)
    monkeypatch.setitem(sys.modules, "mujoco", None)
    with pytest.raises(MissingExtra, match=r"pip install 'sainet\[mujoco\]'"):
        sn.from_mjcf(PUCKS)


def test_a_network_is_trained_around_it(pucks, pushes, tmp_path):
    out = tmp_path / "network"
    network = sn.tune("sain", pushes, engine=pucks, iterations=2, out=out)
    assert network.internal == pucks.internal
    np.testing.assert_allclose(final(network), final(pucks), atol=0.2)
    np.testing.assert_array_equal(final(sn.load(out)), final(network))
    del OWN[pucks.internal.simulator.name]
    with pytest.raises(UnknownName, match="or `from_mjcf`"):
        sn.load(out)
    sn.from_mjcf(PUCKS)  # registers it again
    sn.load(out)


def test_an_edited_file_is_another_engine(edited):
    one, other = (
        sn.from_mjcf(PUCKS, name="x"),
        sn.from_mjcf(edited("0.4", "0.5"), name="x"),
    )
    assert one.internal != other.internal


def test_its_frictions_are_identified(pucks, pushes, tmp_path):
    few = pushes.store.take(np.arange(6))
    arrays, info = few.read(slice(None)), few.info
    arrays |= {"table_friction": np.full(6, 0.15, np.float32)}
    scene, rubbed = to_scene(arrays, info), jnp.full(6, 0.17)
    scene = eqx.tree_at(lambda s: s.pusher_friction, scene, rubbed)
    push = to_initial(arrays), to_controls(arrays, info)
    motion = from_trajectory(predict(pucks.dynamics, scene, *push))[0]
    arrays |= {"truth": motion, "measured": motion[..., :3]}
    write_store(tmp_path, info, arrays)
    known = sn.identify(sn.Pushes(open_store(tmp_path)), engine=pucks).identified
    estimates = {each.name: each.value for each in known.estimates}
    assert estimates["pusher_friction"] == pytest.approx(0.17, rel=0.05)
    assert known.after_mm < 0.3 * known.before_mm


def test_it_plans(pucks):
    planner = sn.make_planner("greedy")
    grid = sn.PushGrid(contact_bins=3, direction_bins=2)
    planner = eqx.tree_at(lambda p: p.actions, planner, grid)
    task = PushToGoal(jnp.array([0.03, 0.0]), moved=0)
    plan = planner.plan(pucks.dynamics, task, SCENE, apart())
    assert plan.distance < 0.015  # m; two pushes of 10 mm
