"""Scales of losses and of networks, by plain loops over what was observed."""

import jax.numpy as jnp
import numpy as np
import pytest

from learning.stores import info_of, made_up, single
from sainet.datasets.batch import to_batch
from sainet.learning import loss
from sainet.learning.loss import feature_scales, known_deviation, loss_weights
from sainet.learning.recipes import Objective
from sainet.models.contacts import ContactFeatures
from sainet.models.integrators import RelaxingResidual
from sainet.scenes.scene import TIME_STEP

PUSHES, STEPS = 6, 12
FEATURES = ContactFeatures(TIME_STEP)


@pytest.fixture(scope="module")
def batch():
    """Pushes of unequal numbers of observed steps; NaN where nothing was observed."""
    info = info_of(PUSHES)
    arrays = made_up(info)
    seen = np.random.default_rng(1).random((2, PUSHES, STEPS)) < 0.6
    seen[:, :, -1] = True
    arrays |= {"pose_observed": seen[0], "rate_observed": seen[1]}
    truth = arrays["truth"].copy()
    truth[..., :3][~seen[0]], truth[..., 3:][~seen[1]] = np.nan, np.nan
    return to_batch(single(arrays | {"truth": truth}), info, simulated="planar")


def errors_of(batch):
    """Errors of s-bar at observed steps, `[step, body, 3]`: of poses, of rates."""
    error = np.asarray(batch.truth, np.float64) - np.asarray(batch.simulated)
    pose, rate = np.asarray(batch.pose_observed), np.asarray(batch.rate_observed)
    return error[..., :3][pose], error[..., 3:][rate]


def test_loss_terms_are_scaled_by_the_errors_of_the_engine(batch):
    objective = Objective(terms="error", weight_rotation=2.0, weight_velocity=3.0)
    found = loss_weights(batch, objective)
    pose, rate = errors_of(batch)
    wanted = {
        "position": 1 / (pose[..., :2] ** 2).sum(-1).mean(),
        "rotation": 2 / (pose[..., 2] ** 2).mean(),
        "velocity": 3 / (rate[..., :2] ** 2).sum(-1).mean(),
        "spin": 1 / (rate[..., 2] ** 2).mean(),
    }
    for name, value in wanted.items():
        assert float(getattr(found, name)) == pytest.approx(value, rel=1e-4), name


def test_an_additive_network_is_scaled_by_what_makes_up_for_the_engines_errors(batch):
    """A constant output of that size, in the equation of the integrator, step by step.

    Its deviation is as large as the error, both averaged over the observed poses.
    """
    integrator = RelaxingResidual()
    found = np.asarray(feature_scales(batch, FEATURES, integrator).acceleration)
    observed = np.asarray(batch.pose_observed)
    reached = np.zeros((STEPS, 3))
    pose, rate = np.zeros(3), np.zeros(3)
    for step in range(STEPS):
        rate = integrator.kept(TIME_STEP) * rate + TIME_STEP * found
        pose = pose + TIME_STEP * rate
        reached[step] = pose
    reached = np.broadcast_to(reached, (PUSHES, STEPS, 3))[observed].mean(axis=0)
    error = np.abs(errors_of(batch)[0]).mean(axis=(0, 1))
    assert found[0] == found[1]
    np.testing.assert_allclose(reached[:2].mean(), error[:2].mean(), rtol=1e-4)
    np.testing.assert_allclose(reached[2], error[2], rtol=1e-4)


def test_statistics_of_contacts_are_those_of_weighted_pushes_and_their_mirror_images():
    rng, signs = np.random.default_rng(2), (1, -1, 1, -1)
    inputs = rng.normal([[0.5], [2.0], [-1.0], [0.3]], 0.7, (4, 30))
    weights = np.maximum(rng.normal(size=30), 0)
    both = np.concatenate([inputs, np.array(signs)[:, None] * inputs], axis=1)
    mean = np.average(both, axis=1, weights=np.tile(weights, 2))
    square = np.average(both**2, axis=1, weights=np.tile(weights, 2))
    shape = (4, 2, 5, 3)  # feature, other, body, push
    found = loss._spread(
        jnp.asarray(inputs.reshape(shape)),
        jnp.asarray(weights.reshape(shape[1:])),
        signs,
    )
    np.testing.assert_allclose(found[0], mean, atol=1e-6)
    np.testing.assert_allclose(found[1], np.sqrt(square - mean**2), rtol=1e-5)


def test_deviations_of_rounding_are_one():
    mean = jnp.array([0.0, 0.9, -0.9, 5.0])
    found = known_deviation(mean, jnp.array([1e-8, 1e-5, 1e-5, 1.0]))
    np.testing.assert_allclose(found, [1e-8, 1.0, 1.0, 1.0])
