"""Contact networks: what is zero by construction, symmetries, and a naive reference."""

from functools import lru_cache

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from models.samples import Glide, pushes
from sainet.engines.planar.engine import PlanarEngine
from sainet.models.contacts import CREEP, REACH, SHARE, ContactFeatures
from sainet.models.correctors.contact import HOLD, ContactNetwork
from sainet.models.correctors.network import Scales
from sainet.models.dynamics import PhysicsDynamics, SimulatorAugmented, predict
from sainet.models.inputs import Drive, Moment, Still
from sainet.scenes.pushes import Push, command_path
from sainet.scenes.scene import TIME_STEP, Scene
from sainet.scenes.state import at_rest, pack_motion

STEPS = 48


@lru_cache
def network(hold: int = HOLD) -> ContactNetwork:
    """A network with large effects: its last layers are drawn as well."""
    features = ContactFeatures(TIME_STEP)
    rng = np.random.default_rng(3)

    def drawn(size):
        return jnp.asarray(rng.uniform(0.05, 0.2, size), jnp.float32)

    scales = Scales(
        pair_mean=jnp.zeros(features.pair_size),
        pair_deviation=drawn(features.pair_size).at[0].set(1e-3),
        body_mean=jnp.zeros(features.body_size),
        body_deviation=drawn(features.body_size).at[0].set(1e-3),
        acceleration=jnp.array([0.5, 0.5, 10.0]),
    )
    made = ContactNetwork(features, key=jax.random.key(0), scales=scales, hold=hold)
    keys = jax.random.split(jax.random.key(1), 2)
    where = lambda n: (n.rel.weights[-1], n.dyn.weights[-1])  # noqa: E731
    last = (jax.random.normal(key, (32, 3)) for key in keys)
    return eqx.tree_at(where, made, tuple(last))


def around_planar(hold: int = HOLD) -> SimulatorAugmented:
    return SimulatorAugmented(network(hold), PlanarEngine())


def push_of(places, radius, contact=0.3):
    """A push of disks at some places, along the x axis, in a batch of one."""
    scene = Scene.disks(mass=[1.0] * len(radius), radius=list(radius))
    zeros = jnp.zeros(len(radius))
    position = jnp.asarray(places, jnp.float32)
    state = at_rest(position, zeros, position[0])
    push = Push(contact, 0.1)
    state, controls = command_path(scene, state, push, steps=STEPS)
    return jax.tree.map(lambda x: x[None], (scene, state, controls))


def moment(rng, bodies=3):
    """A moment of two pushes in which disks nearly touch and move, in columns."""
    radius = rng.uniform(0.05, 0.06, (bodies, 2))
    place = np.cumsum(2 * radius + rng.uniform(-1e-3, 3e-3, radius.shape), axis=0)
    motion = rng.normal(0, 0.02, (6, bodies, 2))
    motion[0], motion[1] = place, rng.normal(0, 0.002, place.shape)
    pusher = np.stack([motion[0, 0] - radius[0] - 0.0055, motion[1, 0] + 0.01])
    arrays = (
        motion,
        Still(
            mass=rng.uniform(0.8, 1.2, radius.shape),
            radius=radius,
            pushed=np.eye(bodies)[:1].repeat(2, 0).T,
            pusher_radius=np.full(2, 0.005),
            origin=np.zeros((2, 2)),
            heading=np.ones((2, 2)),
        ),
        Drive(
            action=rng.normal([[0.05], [0.0]], 0.01, (2, 2)),
            pusher=pusher,
            simulated_pose_step=rng.normal(0, 1e-4, (3, bodies, 2)),
            simulated_rate_step=rng.normal(0, 1e-4, (3, bodies, 2)),
        ),
    )
    return Moment(*jax.tree.map(lambda x: jnp.asarray(x, jnp.float32), arrays))


def naive_layers(layers, x):
    for index, (w, b) in enumerate(zip(layers.weights, layers.biases, strict=True)):
        x = np.asarray(w, float).T @ x + np.asarray(b, float)
        x = x if index == len(layers.weights) - 1 else np.maximum(x, 0)
    return x


def smooth(share):
    share = np.clip(share, 0, 1)
    return share**2 * (3 - 2 * share)


def closing(normal, own, other):
    towards = max(own[:2] @ normal, 0) + max(-(other[:2] @ normal), 0)
    speeds = np.linalg.norm(own[:2]) + np.linalg.norm(other[:2]) + CREEP
    return smooth(towards / speeds / SHARE)


def naive_acceleration(net, now, push):
    """Loops over bodies and contacts, with rotation matrices."""
    motion = np.asarray(now.motion, float)[..., push]
    still = jax.tree.map(lambda x: np.asarray(x, float)[..., push], now.still)
    drive = jax.tree.map(lambda x: np.asarray(x, float)[..., push], now.drive)
    simulated = drive.simulated_pose_step / TIME_STEP
    scales = jax.tree.map(lambda x: np.asarray(x, float), net.scales)
    bodies = motion.shape[1]
    total, acting = np.zeros((3, bodies)), np.zeros(bodies)
    flip = np.array([1, -1, -1])

    def add(body, layers, offset, *, reach, rates, rest, spread, acts):
        distance = np.linalg.norm(offset)
        normal = offset / distance
        turn = np.array([normal, [-normal[1], normal[0]]])
        local = [np.array([*(turn @ rate[:2]), *rate[2:]]) for rate in rates]
        mirrored = [each * flip[: len(each)] for each in local]
        gap = distance - reach
        found = []
        for each in (local, mirrored):
            x = np.concatenate([[gap], *each, rest])
            x = 4 * np.tanh((x - spread[0]) / spread[1] / 4)
            found.append(naive_layers(layers, x))
        out = (found[0] + flip * found[1]) / 2
        weight = smooth(1 - gap / REACH) * acts(normal)
        total[:, body] += weight * np.array([*(turn.T @ out[:2]), out[2]])
        acting[body] += weight

    for i in range(bodies):
        own = [motion[3:6, i], simulated[:, i]]
        mass, radius = still.mass, still.radius
        add(
            i,
            net.dyn,
            drive.pusher - motion[:2, i],
            reach=radius[i] + still.pusher_radius,
            rates=[drive.action, *own],
            rest=[mass[i], radius[i], still.pusher_radius],
            spread=(scales.body_mean, scales.body_deviation),
            acts=lambda n, own=own: closing(n, own[0], drive.action),
        )
        for j in range(bodies):
            if i == j:
                continue
            other = [motion[3:6, j], simulated[:, j]]
            add(
                i,
                net.rel,
                motion[:2, j] - motion[:2, i],
                reach=radius[i] + radius[j],
                rates=[own[0], other[0], own[1], other[1]],
                rest=[mass[i], radius[i], mass[j], radius[j]],
                spread=(scales.pair_mean, scales.pair_deviation),
                acts=lambda n, own=own, other=other: max(
                    closing(n, own[0], other[0]), closing(n, own[1], other[1])
                ),
            )
    return total / np.maximum(acting, 1) * scales.acceleration[:, None]


@pytest.mark.parametrize("bodies", [1, 2, 4])
def test_the_residual_is_that_of_a_loop_over_contacts(bodies):
    now = moment(np.random.default_rng(bodies), bodies)
    found = np.asarray(network().acceleration(now))
    for push in range(2):
        wanted = naive_acceleration(network(), now, push)
        assert np.abs(wanted).max() > 0.01
        np.testing.assert_allclose(found[..., push], wanted, rtol=2e-4, atol=2e-4)


def test_an_untrained_network_predicts_as_its_engine():
    batch = pushes("robot", 3)
    fresh = ContactNetwork(ContactFeatures(TIME_STEP), key=jax.random.key(0))
    found = predict(SimulatorAugmented(fresh, Glide()), *batch).states
    wanted = predict(PhysicsDynamics(Glide()), *batch).states
    np.testing.assert_allclose(pack_motion(found), pack_motion(wanted), atol=1e-6)


IN_CONTACT = [[0.0, 0.0], [0.108, 0.02]]


def test_a_far_disk_changes_nothing_to_the_last_bit():
    radius = [0.055, 0.0548, 0.05]
    ends = []
    for far in ([0.6, 0.5], [-0.4, 0.7], [0.9, -0.9]):
        states = predict(around_planar(), *push_of([*IN_CONTACT, far], radius)).states
        ends.append(np.asarray(states.position[..., :2, :]).tobytes())
        moved = np.abs(np.asarray(states.position[..., 2, :]) - np.float32(far))
        assert moved.max() < 2e-7  # the rounding of the push frame
    assert ends[0] == ends[1] == ends[2]


def test_disks_of_which_two_are_near_move_as_two_alone():
    radius = [0.055, 0.0548]
    pair = predict(around_planar(), *push_of(IN_CONTACT, radius)).states
    far = [[0.6, 0.5], [-0.4, 0.7], [0.5, -0.6]]
    whole = push_of([*IN_CONTACT, *far], [*radius, 0.05, 0.06, 0.055])
    many = predict(around_planar(), *whole).states
    moved = np.abs(pack_motion(many)[..., :2, :3] - pack_motion(pair)[..., :3])
    assert float(moved.max()) < 1e-6
    physics = predict(PhysicsDynamics(PlanarEngine()), *push_of(IN_CONTACT, radius))
    residual = np.abs(np.asarray(pair.position - physics.states.position))
    assert residual.max() > 1e-4  # the network does change the prediction


def test_effects_begin_continuously_at_their_reach():
    now = moment(np.random.default_rng(5), 2)
    gap = np.linspace(-1e-4, 1.5 * REACH, 400)
    place = jnp.asarray(now.still.radius.sum(axis=0)[None] + gap[:, None], jnp.float32)

    def at(x):
        motion = now.motion.at[0, 1].set(now.motion[0, 0] + x).at[1].set(0.0)
        far = now.drive._replace(pusher=now.drive.pusher - 1.0)
        return network().acceleration(Moment(motion, now.still, far))

    found = np.asarray(jax.vmap(at)(place))[..., 0]  # [gap, 3, body]
    assert (found[gap > REACH + 1e-5] == 0).all()
    assert np.abs(found).max() > 0.01
    assert np.abs(np.diff(found, axis=0)).max() < 0.03 * np.abs(found).max()


def test_a_disk_at_rest_beside_a_passing_one_stays_at_rest():
    now = moment(np.random.default_rng(6), 2)
    place = jnp.array([0.0, 1.0])[:, None] * now.still.radius.sum(axis=0)[None]
    motion = jnp.zeros_like(now.motion).at[1].set(place).at[3, 0].set(0.05)
    still = jnp.zeros_like(now.drive.simulated_pose_step)
    passing = still.at[0, 0].set(0.05 * TIME_STEP)
    drive = now.drive._replace(pusher=now.drive.pusher - 1, simulated_pose_step=passing)
    assert not network().acceleration(Moment(motion, now.still, drive))[:, 1].any()
    towards = motion.at[4, 0].set(0.05)
    assert network().acceleration(Moment(towards, now.still, drive))[:, 1].any()


def test_a_mirrored_push_has_the_mirrored_motion():
    scene, state, controls = push_of([*IN_CONTACT, [0.2, -0.03]], [0.055, 0.0548, 0.05])
    plain = predict(around_planar(), scene, state, controls).states
    mirrored = predict(around_planar(), scene, state.mirrored(), controls.mirrored())
    gap = pack_motion(plain.mirrored()) - pack_motion(mirrored.states)
    assert float(np.abs(gap).max()) < 2e-5


@pytest.mark.parametrize("part", [HOLD, 3 * HOLD])
def test_two_parts_of_whole_holds_are_one_long_prediction(part):
    scene, state, controls = push_of(IN_CONTACT, [0.055, 0.0548])
    model = around_planar()
    whole = pack_motion(predict(model, scene, state, controls).states)
    carry, first = model.advance(
        scene, model.begin(scene, state), jax.tree.map(lambda x: x[:, :part], controls)
    )
    rest = jax.tree.map(lambda x: x[:, part:], controls)
    second = model.advance(scene, carry, rest)[1]
    both = [pack_motion(each.states) for each in (first, second)]
    gap = np.abs(jnp.concatenate(both, axis=1) - whole)
    assert gap[..., :3].max() < 1e-6
    assert gap[..., 3:].max() < 1e-4  # m/s and rad/s


def test_a_shorter_hold_changes_little():
    batch = push_of(IN_CONTACT, [0.055, 0.0548])
    held, every = (
        predict(around_planar(hold), *batch).final.position for hold in (HOLD, 1)
    )
    start = batch[1].position
    off, far = (np.abs(np.asarray(x)).max() for x in (held - every, every - start))
    assert off < 0.1 * far
