"""Zero-order hold of additive networks: equal predictions with fewer evaluations."""

from dataclasses import replace
from functools import partial

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from learning.stores import info_of, made_up
from models.samples import network
from sainet.datasets.batch import to_batch
from sainet.learning.batches import predict_batch
from sainet.learning.loss import feature_scales
from sainet.learning.recipes import PAPER
from sainet.models.correctors import Start
from sainet.models.correctors.held import _mean, unroll_held
from sainet.models.inputs import push_frame
from sainet.models.integrators import RelaxingResidual
from sainet.runs.errors import BadInput
from sainet.scenes.scene import TIME_STEP

STEPS = 30


def batch_of(bodies=2):
    """Pushes that have the length of no whole number of blocks of 8."""
    info = info_of(3, bodies=bodies, steps=STEPS)
    return to_batch(made_up(info), info, simulated="planar")


def predicted(of, batch, hold):
    return np.asarray(jax.jit(predict_batch, static_argnums=2)(of, batch, hold))


@pytest.fixture
def residual():
    """A network with small, slowly changing outputs, like trained networks."""
    made = network("sain", "robot", residual=True)
    last = lambda n: n.dyn.weights[-1]  # noqa: E731
    return eqx.tree_at(last, made, 0.1 * last(made))


def constant(of):
    """A network with a constant output: the bias of its last layer."""
    last = lambda n: (n.dyn.weights[-1], n.dyn.biases[-1])  # noqa: E731
    weight, bias = last(of)
    said = (jnp.zeros_like(weight), jnp.array([0.5, -0.2, 1.0], bias.dtype))
    return eqx.tree_at(last, of, said)


@pytest.mark.parametrize("bodies", [1, 2])
def test_a_hold_of_one_step_changes_nothing(residual, bodies):
    batch = batch_of(bodies)
    frame = push_frame(batch.scene, batch.initial)
    found = residual.in_frame(
        batch.scene,
        Start(batch.initial, frame, batch.initial),
        batch.controls,
        batch.simulated,
        unroll=partial(unroll_held, hold=1),
    )
    np.testing.assert_allclose(found, predicted(residual, batch, 1), atol=2e-6)


@pytest.mark.parametrize("hold", [2, 8, 100])
def test_a_constant_network_may_be_held(residual, hold):
    made, batch = constant(residual), batch_of()
    found = predicted(made, batch, hold)
    np.testing.assert_allclose(found, predicted(made, batch, 1), atol=2e-6)


def test_the_last_block_is_the_mean_of_the_steps_that_it_has():
    steps = np.random.default_rng(0).normal(size=(2, 11, 1, 3))
    found = _mean(jnp.asarray(steps, jnp.float32), 4)
    wanted = [steps[:, at : at + 4].mean(axis=1) for at in (0, 4, 8)]
    np.testing.assert_allclose(found, np.stack(wanted, axis=1), rtol=1e-5)


def test_a_shorter_hold_is_more_accurate(residual):
    batch = batch_of()
    wanted = predicted(residual, batch, 1)
    deviation = np.abs(wanted - predicted(constant(residual), batch, 1)).max()
    off = [np.abs(predicted(residual, batch, hold) - wanted).max() for hold in (8, 2)]
    assert 0 < off[1] < off[0] / 2
    assert off[0] < 0.1 * deviation


def test_networks_of_the_papers_form_are_never_held():
    made, batch = network("sain", "robot"), batch_of()
    np.testing.assert_array_equal(predicted(made, batch, 8), predicted(made, batch, 1))


@pytest.mark.parametrize("held", [True, False])
def test_the_gains_equal_single_steps(held):
    form, change = RelaxingResidual(), float(held)
    gain = form.gains(TIME_STEP, 50)
    pose, rate, poses, rates = 0.0, 1.0 - change, [], []
    for _ in range(50):
        rate = form.kept(TIME_STEP) * rate + TIME_STEP * change
        pose += TIME_STEP * rate
        rates.append(rate)
        poses.append(pose)
    np.testing.assert_allclose(rates, gain[1] if held else gain[0])
    np.testing.assert_allclose(poses, gain[3] if held else gain[2])


def test_additive_outputs_are_scaled_by_the_engines_error(residual):
    batch = batch_of(1)
    last = np.zeros((batch.size, STEPS), bool)
    last[:, -1] = True
    batch = replace(
        batch, pose_observed=jnp.asarray(last), rate_observed=jnp.asarray(last & False)
    )
    scales = feature_scales(batch, residual.features, residual.integrator)
    one = (jnp.zeros_like(residual.dyn.weights[-1]), jnp.ones(3))
    said = eqx.tree_at(lambda n: (n.dyn.weights[-1], n.dyn.biases[-1]), residual, one)
    said = eqx.tree_at(lambda n: n.scales, said, scales)
    silent = eqx.tree_at(lambda n: n.dyn.biases[-1], said, jnp.zeros(3))
    moved = predicted(said, batch, 1) - predicted(silent, batch, 1)
    wrong = np.abs(np.asarray(batch.truth - batch.simulated))[:, -1, 0, :3].mean(axis=0)
    wrong[:2] = wrong[:2].mean()  # x and y share a scale
    np.testing.assert_allclose(
        moved[-1, :, 0, :3], np.tile(wrong, (batch.size, 1)), rtol=1e-3
    )
    assert scales.acceleration[0] == scales.acceleration[1]


def test_a_hold_of_zero_steps_is_refused():
    with pytest.raises(BadInput, match="`hold` is 0"):
        PAPER.changed(hold=0)
