"""The interaction network against the paper's equations, written as plain loops."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from contracts.worlds import make_scene
from models import naive
from models.samples import (
    PUSHES,
    Glide,
    assumed,
    dynamics,
    network,
    pushes,
    quick_dynamics,
)
from sainet.engines.base import AbstractEngine
from sainet.learning.task import widen
from sainet.models.correctors.interaction import InteractionNetwork
from sainet.models.dynamics import (
    PhysicsDynamics,
    SimulatorAugmented,
    predict,
    stored_prediction,
)
from sainet.models.features import feature_set
from sainet.models.inputs import (
    in_columns,
    motion_from_frame,
    motion_to_frame,
    near_pairs,
    push_frame,
    still_features,
)
from sainet.models.integrators import RelaxingResidual
from sainet.scenes.pushes import Push, command_path
from sainet.scenes.scene import TIME_STEP, pair_gaps
from sainet.scenes.state import at_rest, pack_motion

every_model = pytest.mark.parametrize("model", ["in", "sain"])
every_kind = pytest.mark.parametrize("kind", ["robot", "direct-force"])


def moving_pushes(kind: str, bodies: int, steps: int = 24):
    """Pushes whose disks already move, so that no feature is zero."""
    scene, initial, controls = pushes(kind, bodies, steps)
    rng = np.random.default_rng(bodies)
    where = lambda s: (s.velocity, s.spin)  # noqa: E731
    drawn = (
        jnp.asarray(rng.normal(0, 0.05, x.shape), jnp.float32) for x in where(initial)
    )
    return scene, eqx.tree_at(where, initial, tuple(drawn)), controls


@pytest.mark.parametrize("bodies", [1, 2, 3])
@every_kind
@every_model
def test_the_network_is_the_papers_equations(model, kind, bodies):
    batch = moving_pushes(kind, bodies)
    made = quick_dynamics(model, kind)
    found = np.asarray(pack_motion(predict(made, *batch).states))
    simulated = None
    if model == "sain":
        rollout = eqx.filter_jit(made.engine.rollout)(*batch)
        simulated = np.asarray(pack_motion(rollout.states), np.float64)
    for push in range(PUSHES):
        wanted = naive.rollout(made.network, batch, simulated, push)
        np.testing.assert_allclose(found[push], wanted, atol=2e-5)


@pytest.mark.parametrize("bodies", [1, 2, 3])
@every_kind
def test_the_residual_form_adds_the_engines_steps(kind, bodies):
    batch = moving_pushes(kind, bodies)
    made = SimulatorAugmented(network("sain", kind, residual=True), Glide())
    found = np.asarray(pack_motion(predict(made, *batch).states))
    rollout = eqx.filter_jit(made.engine.rollout)(*batch)
    simulated = np.asarray(pack_motion(rollout.states), np.float64)
    for push in range(PUSHES):
        wanted = naive.rollout(made.network, batch, simulated, push)
        np.testing.assert_allclose(found[push], wanted, atol=2e-5)


class Unavailable(AbstractEngine):
    """An engine that must not run."""

    def rollout(self, scene, initial, controls):
        raise AssertionError("the engine ran although its prediction is stored")


@every_kind
def test_a_stored_prediction_replaces_the_engine(kind):
    batch = moving_pushes(kind, 2)
    simulated = eqx.filter_jit(Glide().rollout)(*batch)
    stored = stored_prediction(pack_motion(simulated.states), *batch[1:])
    net = network("sain", kind)
    wanted = predict(SimulatorAugmented(net, Glide()), *batch).states
    found = predict(SimulatorAugmented(net, Unavailable()), *batch, stored).states
    np.testing.assert_allclose(pack_motion(found), pack_motion(wanted), atol=1e-6)
    found = predict(PhysicsDynamics(Unavailable()), *batch, stored).states
    np.testing.assert_array_equal(pack_motion(found), pack_motion(simulated.states))


@every_kind
def test_an_untrained_additive_network_equals_the_engine(kind):
    batch = moving_pushes(kind, 2)
    features, key = feature_set(kind, simulator=True), jax.random.key(0)
    silent = InteractionNetwork(
        features, time_step=TIME_STEP, key=key, integrator=RelaxingResidual()
    )
    inside = assumed([0, 1])
    found = pack_motion(predict(SimulatorAugmented(silent, inside), *batch).states)
    wanted = pack_motion(predict(PhysicsDynamics(inside), *batch).states)
    np.testing.assert_allclose(found[..., :3], wanted[..., :3], atol=2e-5)
    np.testing.assert_allclose(found[..., 3:], wanted[..., 3:], atol=2e-4)


@pytest.mark.parametrize(
    "name", ["place", "letter", "letter-push-frame", "letter-motion", "unbounded"]
)
@every_kind
@every_model
def test_a_network_with_other_features_equals_the_loop(model, kind, name):
    batch = moving_pushes(kind, 2)
    made = quick_dynamics(model, kind)
    seeing = network(model, kind, name=name)
    made = eqx.tree_at(lambda d: d.network, made, seeing)
    found = np.asarray(pack_motion(predict(made, *batch).states))
    simulated = None
    if model == "sain":
        rollout = eqx.filter_jit(made.engine.rollout)(*batch)
        simulated = np.asarray(pack_motion(rollout.states), np.float64)
    wanted = naive.rollout(seeing, batch, simulated, 1)
    np.testing.assert_allclose(found[1], wanted, atol=2e-5)


@every_model
def test_a_widened_network_makes_the_same_predictions(model):
    batch = moving_pushes("robot", 2)
    made = quick_dynamics(model, "robot")
    scales = network(model, "robot", seed=3, name="place").scales
    wide = eqx.tree_at(lambda d: d.network, made, widen(made.network, scales))
    assert wide.network.features == network(model, "robot", name="place").features
    plain, found = (predict(d, *batch).states for d in (made, wide))
    np.testing.assert_allclose(found.position, plain.position, atol=1e-7)
    np.testing.assert_allclose(found.angle, plain.angle, atol=1e-6)
    # The new weights count as soon as they are not zero.
    first = lambda d: d.network.dyn.weights[0]  # noqa: E731
    known = made.network.features.body_size
    loud = eqx.tree_at(first, wide, first(wide).at[known : known + 6].set(1.0))
    moved = predict(loud, *batch).states.position - plain.position
    assert np.abs(np.asarray(moved)).max() > 1e-5


@every_kind
@every_model
def test_effects_and_the_simulator_matter(model, kind):
    """Guards the oracle: a part of the network that did nothing would go unseen."""
    scene, initial, controls = moving_pushes(kind, 2)
    made = quick_dynamics(model, kind)
    plain = predict(made, scene, initial, controls).final.position

    def moved_by(other):
        gap = predict(other, scene, initial, controls).final.position - plain
        return float(jnp.abs(gap).max())

    silent = eqx.tree_at(
        lambda d: d.network.rel, made, jax.tree.map(jnp.zeros_like, made.network.rel)
    )
    assert moved_by(silent) > 1e-4
    if model == "sain":
        other = eqx.tree_at(lambda d: d.engine, made, assumed([0, 1]))
        assert moved_by(other) > 1e-5


def test_near_pairs_have_gaps_within_reach():
    x = [0.0, 0.119, 0.24, 0.36]  # gaps of 19, 21 and 20 mm, radii of 50 mm
    scene = make_scene(np.ones((1, 4)), [[0.05, 0.05, 0.05, 0.05]])
    place = jnp.stack([jnp.array(x), jnp.zeros(4)], axis=-1)[None]
    state = at_rest(place, jnp.zeros((1, 4)), jnp.full((1, 2), -1.0))
    still = still_features(scene, push_frame(scene, state))
    found = near_pairs(in_columns(pack_motion(state)), in_columns(still), 0.0205)
    gaps = np.asarray(pair_gaps(scene, state))[0]
    wanted = [[gaps[i, (i + k) % 4] <= 0.0205 for i in range(4)] for k in (1, 2, 3)]
    assert np.sum(wanted) == 4  # the first and the last two, both ways round
    np.testing.assert_array_equal(found[..., 0], wanted)


def with_property(scene, name, change):
    where = lambda s: getattr(s, name)  # noqa: E731
    return eqx.tree_at(where, scene, change(where(scene)))


def test_inputs_contain_masses_and_radii_but_no_friction():
    scene, initial, controls = pushes("robot", 2)
    made = quick_dynamics("in", "robot")
    plain = predict(made, scene, initial, controls).final.position
    for name in ("table_friction", "disk_friction", "pusher_friction"):
        other = with_property(scene, name, lambda value: value + 0.3)
        same = predict(made, other, initial, controls).final.position
        np.testing.assert_array_equal(same, plain)
    for name in ("mass", "radius"):
        other = with_property(scene, name, lambda value: 1.05 * value)
        differs = predict(made, other, initial, controls).final.position
        assert np.abs(np.asarray(differs - plain)).max() > 1e-6


def test_predictions_contain_no_static_properties():
    scene, initial, controls = pushes("robot", 2)
    states = predict(quick_dynamics("in", "robot"), scene, initial, controls).states
    names = {"position", "angle", "velocity", "spin"}
    assert vars(states).keys() == names | {"pusher_position", "pusher_velocity"}


def test_the_nearest_disk_is_the_pushed_disk():
    # By surfaces: the centre of disk 1 is nearer, the surface of disk 2 is.
    scene = make_scene([[1.0, 1.0, 1.0]], [[0.02, 0.06, 0.05]])
    place = jnp.array([[[0.07, 0.0], [0.0, 0.08], [0.3, 0.3]]])
    state = at_rest(place, jnp.zeros((1, 3)), jnp.zeros((1, 2)))
    frame = push_frame(scene, state)
    np.testing.assert_array_equal(frame.pushed, [[0, 1, 0]])
    np.testing.assert_allclose(frame.origin, [[0, 0.08]])
    np.testing.assert_allclose(frame.angle, [np.pi / 2], rtol=1e-6)


@every_kind
def test_the_push_frame_has_its_x_axis_along_the_normal(kind):
    scene, initial, controls = moving_pushes(kind, 2)
    frame = push_frame(scene, initial)
    motion = pack_motion(initial)
    local = motion_to_frame(motion, frame)
    for push in range(PUSHES):
        one = naive.local_push(scene, initial, controls, push)
        np.testing.assert_allclose(local[push], one.start, atol=1e-6)
        np.testing.assert_allclose(local[push, one.pushed, :2], 0, atol=1e-7)
    np.testing.assert_allclose(motion_from_frame(local, frame), motion, atol=1e-6)
    commands = controls.in_frame(frame.origin, frame.angle)
    if kind == "robot":
        gap = scene.radius[:, 0] + scene.pusher_radius
        # The command at the end of the first step is at most one step further on.
        np.testing.assert_allclose(commands.position[:, 0, 0], -gap, atol=3e-4)
    else:
        np.testing.assert_allclose(commands.contact_offset[:, 1], 0, atol=1e-6)


def overlapping_push():
    """Disks that overlap by 3 mm, the pusher 3 mm inside the first, for 200 steps."""
    scene = make_scene([[0.9, 1.1]] * 2, [[0.055, 0.052]] * 2)
    place = jnp.array([[[0.0, 0.0], [0.104, 0.0]], [[0.2, 0.1], [0.2, 0.204]]])
    state = at_rest(place, jnp.zeros((2, 2)), place[:, 0])
    one = jnp.ones(2)
    push = Push(0 * one, 0 * one, 0.01 * one, 0.05 * one)
    return scene, *command_path(scene, state, push, steps=200, gap=-0.003)


def test_gradients_are_finite_over_a_whole_push_that_starts_in_overlap():
    scene, state, controls = overlapping_push()
    made = dynamics("sain", "robot", [0, 1])

    @eqx.filter_jit
    @eqx.filter_grad
    def gradient(net, made, *push):
        made = eqx.tree_at(lambda d: d.network, made, net)
        _, path = made.advance(push[0], made.begin(*push[:2]), push[2])
        return jnp.sum(path.final.position**2)

    found = gradient(made.network, made, scene, state, controls)
    layers = jax.tree.leaves((found.rel, found.dyn))
    assert all(np.isfinite(leaf).all() for leaf in layers)
    assert max(np.abs(leaf).max() for leaf in layers) > 1e-6
