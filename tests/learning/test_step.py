"""One gradient step: loss, gradient, devices, schedule, l2 and guards, taken apart."""

import jax
import jax.numpy as jnp
import numpy as np
import optax
import pytest

from learning.stores import end_points_alone, info_of, made_up, single
from models import naive
from models.samples import network
from sainet.datasets.batch import to_batch
from sainet.learning.batches import predict_batch
from sainet.learning.loss import (
    LossWeights,
    feature_scales,
    loss_weights,
    to_target,
)
from sainet.learning.recipes import PAPER, Objective, Optimiser
from sainet.learning.step import (
    data_loss,
    even_batch,
    first_state,
    make_gradient,
    make_optimizer,
    make_step,
    trained_layers,
    with_layers,
)

PUSHES = 6
WEIGHTS = LossWeights(*map(jnp.float32, (1e4, 1e2, 1e2, 1.0)))


def batch_of(model="sain", pushes=PUSHES, change=lambda arrays: arrays, **changes):
    info = info_of(pushes, **changes)
    arrays = single(change(made_up(info)))
    return to_batch(arrays, info, simulated="planar" if model == "sain" else None)


def assert_same_tree(found, wanted, rtol):
    """Arrays agree to a fraction of the largest number of each."""
    for one, other in zip(jax.tree.leaves(found), jax.tree.leaves(wanted), strict=True):
        gap = np.abs(np.asarray(one) - np.asarray(other)).max()
        assert gap <= rtol * np.abs(np.asarray(other)).max() + 1e-12


@jax.jit
def plain_gradient(net, batch):
    """On one device, nothing split."""

    def loss(layers):
        return data_loss(with_layers(net, layers), batch, WEIGHTS)

    return jax.value_and_grad(loss)(trained_layers(net))


@pytest.fixture(scope="module")
def split_gradient():
    return make_gradient(WEIGHTS)


@pytest.mark.parametrize("model", ["in", "sain"])
def test_training_predicts_with_the_papers_equations(model):
    batch = batch_of(model)
    net = network(model, "robot")
    found = np.asarray(predict_batch(net, batch))
    simulated = None if model == "in" else np.asarray(batch.simulated, np.float64)
    target = to_target(batch)
    for push in range(PUSHES):
        parts = (batch.scene, batch.initial, batch.controls)
        local = naive.local_push(*parts, push)
        wanted = naive.rollout(net, parts, simulated, push)
        wanted = np.array([naive.to_local(local, motion) for motion in wanted])
        np.testing.assert_allclose(found[:, push], wanted, atol=3e-5)
        truth = np.array([naive.to_local(local, m) for m in batch.truth[push]])
        np.testing.assert_allclose(target.pose[:, push], truth[..., :3], atol=1e-6)
        np.testing.assert_allclose(target.rate[:, push], truth[..., 3:], atol=1e-6)


def test_targets_are_the_measured_poses():
    batch = batch_of("in", change=lambda a: a | {"measured": a["truth"][..., :3] + 0.5})
    truth, target = to_target(batch_of("in")), to_target(batch)
    np.testing.assert_array_equal(target.rate, truth.rate)
    gap = np.linalg.norm(np.asarray(target.pose - truth.pose)[..., :2], axis=-1)
    np.testing.assert_allclose(gap, np.sqrt(0.5), rtol=1e-4)


def test_two_devices_find_the_gradient_of_one(split_gradient):
    assert jax.device_count() == 2
    batch, net = batch_of(), network("sain", "robot")
    found, wanted = split_gradient(net, batch), plain_gradient(net, batch)
    assert float(wanted[0]) > 1
    assert_same_tree(found, wanted, 1e-5)


def test_padding_a_batch_changes_nothing(split_gradient):
    batch, net = batch_of(pushes=5), network("sain", "robot")
    filled = even_batch(batch)
    assert (batch.size, filled.size) == (5, 6)
    assert even_batch(filled) is filled
    assert_same_tree(split_gradient(net, filled), plain_gradient(net, batch), 1e-5)


def test_many_pushes_are_summed_in_microbatches(split_gradient):
    batch, net = batch_of(pushes=1101, steps=3), network("sain", "robot")
    filled = even_batch(batch)
    assert filled.size == 1104  # two chunks on each of two devices
    assert even_batch(filled) is filled
    assert_same_tree(split_gradient(net, filled), plain_gradient(net, batch), 1e-5)


def test_unobserved_steps_have_no_gradient(split_gradient):
    net = network("sain", "robot")
    whole = plain_gradient(net, batch_of())
    alone = split_gradient(net, batch_of(change=end_points_alone))
    assert all(np.isfinite(leaf).all() for leaf in jax.tree.leaves(alone))
    assert 0 < float(alone[0]) < float(whole[0])


def test_training_does_not_touch_the_scales():
    state = first_state(network("sain", "robot"), Optimiser())
    after, loss = make_step(PAPER.changed(batch_size=PUSHES), WEIGHTS)(
        state, batch_of()
    )
    wanted = plain_gradient(state.network, batch_of())[0] / PUSHES
    assert float(loss) == pytest.approx(float(wanted), rel=1e-5)
    assert int(after.iteration) == 1
    assert_same_tree(after.network.scales, state.network.scales, 0)
    # Adam's first step is the learning rate, whatever the size of the gradient.
    moved = jax.tree.map(
        lambda a, b: np.abs(a - b).max(),
        trained_layers(after.network),
        trained_layers(state.network),
    )
    np.testing.assert_allclose(jax.tree.leaves(moved), 1e-3, rtol=0.01)


def test_l2_pulls_with_twice_the_weights():
    config = PAPER.changed(batch_size=PUSHES, l2=1e-3, clip_norm=1e9)
    state = first_state(network("in", "robot"), config.optimiser)
    nothing = jax.tree.map(jnp.zeros_like, WEIGHTS)
    after, loss = make_step(config, nothing)(state, batch_of("in"))
    assert float(loss) == 0
    (adam,) = adam_states(after.optimizer)
    found = jax.tree.map(lambda mean: mean / 0.1, adam.mu)  # Adam's b1 is 0.9
    wanted = jax.tree.map(lambda w: 2e-3 * w, trained_layers(state.network))
    assert_same_tree(found, wanted, 1e-5)


def test_l2_pulls_to_the_initial_weights():
    config = PAPER.changed(batch_size=PUSHES, l2=1e-3, clip_norm=1e9)
    state = first_state(network("in", "robot"), config.optimiser)
    nothing = jax.tree.map(jnp.zeros_like, WEIGHTS)
    start = jax.tree.map(lambda w: w + 0.1, trained_layers(state.network))
    after, _ = make_step(config, nothing, start)(state, batch_of("in"))
    (adam,) = adam_states(after.optimizer)
    wanted = jax.tree.map(lambda w: jnp.full_like(w, -2e-4), start)
    found = jax.tree.map(lambda mean: mean / 0.1, adam.mu)
    assert_same_tree(found, wanted, 1e-4)


def test_the_default_l2_is_one_over_the_pushes():
    config = PAPER.changed(l2=None)
    assert config.objective.for_pushes(25).l2 == 0.04
    assert Objective(l2=0.0).for_pushes(25).l2 == 0
    with pytest.raises(ValueError, match="l2 is None"):
        make_step(config, WEIGHTS)


def adam_states(optimizer):
    is_adam = lambda x: isinstance(x, optax.ScaleByAdamState)  # noqa: E731
    return [x for x in jax.tree.leaves(optimizer, is_leaf=is_adam) if is_adam(x)]


def test_the_learning_rate_halves_every_so_many_iterations():
    optimizer = make_optimizer(Optimiser(learning_rate=0.01, halve_every=4))
    weight = jnp.ones(3)
    state, sizes = optimizer.init(weight), []
    for _ in range(12):  # a constant gradient, so that Adam's step is the rate itself
        update, state = optimizer.update(jnp.full(3, 0.2), state, weight)
        sizes.append(float(-update[0]))
    wanted = np.repeat([0.01, 0.005, 0.0025], 4)
    np.testing.assert_allclose(sizes, wanted, rtol=1e-3)


def test_a_cosine_falls_to_zero_at_the_last_iteration():
    optimiser = Optimiser(learning_rate=0.01, decay="cosine", iterations=8)
    optimizer, weight = make_optimizer(optimiser), jnp.ones(3)
    state, sizes = optimizer.init(weight), []
    for _ in range(9):
        update, state = optimizer.update(jnp.full(3, 0.2), state, weight)
        sizes.append(float(-update[0]))
    wanted = 0.005 * (1 + np.cos(np.pi * np.arange(9) / 8))
    np.testing.assert_allclose(sizes, wanted, rtol=1e-3, atol=1e-8)


def test_large_gradients_are_clipped_and_nan_skipped():
    optimizer = make_optimizer(Optimiser(clip_norm=2.0))
    weight = jnp.zeros(2)
    state = optimizer.init(weight)
    _, after = optimizer.update(jnp.array([30.0, 40.0]), state, weight)
    np.testing.assert_allclose(adam_states(after)[0].mu / 0.1, [1.2, 1.6], rtol=1e-5)
    update, skipped = optimizer.update(jnp.array([1.0, jnp.nan]), after, weight)
    np.testing.assert_array_equal(update, 0)
    assert_same_tree(adam_states(skipped), adam_states(after), 0)


# Statistics.


def seen_by_networks(batch):
    """Every input of f_rel and f_dyn along the true paths, by plain loops."""
    pairs, bodies = [], []
    for push in range(batch.size):
        local = naive.local_push(batch.scene, batch.initial, batch.controls, push)
        before = s_before = local.start
        for step in range(batch.truth.shape[1]):
            s_now = naive.to_local(local, batch.simulated[push, step])
            change, s_before = s_now - s_before, s_now
            count = len(before)
            for i in range(count):
                bodies.append(naive.body_inputs(local, before, change[:, :3], step, i))
                pairs += [
                    naive.pair_inputs(local, before, change[:, 3:], i, j)
                    for j in range(count)
                    if j != i
                ]
            before = naive.to_local(local, batch.truth[push, step])
    return np.array(pairs), np.array(bodies)


def spread(values, constant):
    deviation = values.std(0)
    return values.mean(0), np.where(deviation > constant, deviation, 1.0)


def test_scales_are_the_statistics_of_the_inputs():
    batch = batch_of()
    scales = feature_scales(batch, network("sain", "robot").features)
    pairs, bodies = seen_by_networks(batch)
    mean, deviation = spread(pairs, 1e-9)
    np.testing.assert_allclose(scales.pair_mean, mean, rtol=1e-3, atol=2e-6)
    np.testing.assert_allclose(scales.pair_deviation, deviation, rtol=1e-3)
    mean, deviation = spread(bodies, 1e-9)
    np.testing.assert_allclose(scales.body_mean, mean, rtol=1e-3, atol=2e-6)
    np.testing.assert_allclose(scales.body_deviation, deviation, rtol=1e-3)


def test_constant_properties_have_scale_one():
    def of_one_disk(arrays):
        alike = np.ones_like(arrays["mass"])
        return arrays | {"mass": 0.8937 * alike, "radius": 0.0525 * alike}

    batch = batch_of(change=of_one_disk)
    scales = feature_scales(batch, network("sain", "robot").features)
    assert scales.body_deviation[-2:].tolist() == [1, 1]
    assert scales.pair_deviation[-4:].tolist() == [1, 1, 1, 1]


def test_acceleration_scales_are_equal_for_x_and_y():
    batch = batch_of()
    scales = feature_scales(batch, network("sain", "robot").features)
    rates = np.asarray(batch.truth[..., 3:], np.float64)
    steps = np.diff(rates, axis=1, prepend=0) * 240
    size = np.sqrt((steps**2).mean((0, 1, 2)))
    found = np.asarray(scales.acceleration)
    assert found[0] == found[1]
    # The frame turns x and y into each other.
    assert found[0] == pytest.approx(size[:2].mean(), rel=0.02)
    assert found[2] == pytest.approx(size[2], rel=1e-3)


@pytest.mark.parametrize("model", ["in", "sain"])
def test_loss_terms_are_scaled_by_the_motion(model):
    batch = batch_of(model)
    found = loss_weights(batch, Objective(weight_position=2.0, weight_spin=3.0))
    motion = np.asarray(batch.truth, np.float64)
    start = np.zeros((PUSHES, 1, 2, 3))
    start[..., :2] = batch.initial.position[:, None]
    start[..., 2] = batch.initial.angle[:, None]
    moved = motion[..., :3] - start
    squares = {
        "position": 2 / (moved[..., :2] ** 2).sum(-1).mean(),
        "rotation": 1 / (moved[..., 2] ** 2).mean(),
        "velocity": 1 / (motion[..., 3:5] ** 2).sum(-1).mean(),
        "spin": 3 / (motion[..., 5] ** 2).mean(),
    }
    for name, wanted in squares.items():
        assert float(getattr(found, name)) == pytest.approx(wanted, rel=2e-3)


def test_the_papers_loss_is_of_squared_metres_and_radians():
    objective = Objective(terms="metres", weight_spin=3.0)
    found = loss_weights(batch_of("in"), objective)
    names = ("position", "rotation", "velocity", "spin")
    assert [float(getattr(found, name)) for name in names] == [1, 1, 1, 3]


def still(arrays):
    """Pushes in which no disk ever turns."""
    truth = arrays["truth"].copy()
    truth[..., 2] = arrays["initial"][:, None, :, 2]
    truth[..., 5] = 0
    return arrays | {"truth": truth, "simulated_planar": truth}


@pytest.mark.parametrize("change", [still, end_points_alone])
@pytest.mark.parametrize("bodies", [1, 2])
def test_statistics_are_finite_for_incomplete_pushes(change, bodies):
    batch = batch_of(change=change, bodies=bodies)
    scales = feature_scales(batch, network("sain", "robot").features)
    found = (scales, loss_weights(batch, Objective()))
    assert all(np.isfinite(leaf).all() for leaf in jax.tree.leaves(found))


def test_averaged_weights_follow_tensorflow():
    config, batch = PAPER.changed(average=4, learning_rate=1e-2), batch_of()
    step, plain = (
        make_step(config, WEIGHTS),
        make_step(config.changed(average=0), WEIGHTS),
    )
    state = first_state(network("sain", "robot"), config.optimiser)
    alone = first_state(network("sain", "robot"), Optimiser(average=0))
    mean = trained_layers(alone.network)
    for done in range(12):
        state, alone = step(state, batch)[0], plain(alone, batch)[0]
        keep = min(1 - 1 / 4, (1 + done) / (10 + done))
        mean = jax.tree.map(
            lambda old, new, keep=keep: keep * old + (1 - keep) * new,
            mean,
            trained_layers(alone.network),
        )
    assert_same_tree(trained_layers(state.network), trained_layers(alone.network), 0)
    assert_same_tree(trained_layers(state.result), mean, 1e-5)
    assert alone.result is alone.network
