"""The loss of the paper against plain loops, and what was not observed."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from sainet.learning.loss import LossWeights, Target, push_losses

TIME, PUSHES, BODIES = 7, 5, 3
WEIGHTS = LossWeights(*map(jnp.float32, (1.5, 0.7, 0.2, 0.05)))


def random_case(seed=0):
    rng = np.random.default_rng(seed)
    shape = (TIME, PUSHES, BODIES, 3)
    predicted = rng.normal(size=(*shape[:-1], 6))
    pose, rate = rng.normal(size=shape), rng.normal(size=shape)
    seen = rng.random((2, TIME, PUSHES)) < 0.6
    seen[:, 0] = True
    return predicted, pose, rate, *seen


def as_target(pose, rate, pose_seen, rate_seen) -> Target:
    values = (jnp.asarray(x, jnp.float32) for x in (pose, rate))
    return Target(*values, jnp.asarray(pose_seen), jnp.asarray(rate_seen))


def loss_of(predicted, *target):
    return push_losses(jnp.asarray(predicted, jnp.float32), as_target(*target), WEIGHTS)


def plain_loss(case, push):
    """Sum over bodies and mean over the observed steps, one number at a time."""
    predicted, pose, rate, pose_seen, rate_seen = case
    place, turn, velocity, spin = map(float, jax.tree.leaves(WEIGHTS))
    poses, rates = [], []
    for t in range(TIME):
        pose_error = rate_error = 0.0
        for b in range(BODIES):
            x, y, angle, vx, vy, w = predicted[t, push, b]
            tx, ty, true_angle = pose[t, push, b]
            tvx, tvy, tw = rate[t, push, b]
            pose_error += place * ((x - tx) ** 2 + (y - ty) ** 2)
            pose_error += turn * (np.sin(angle) - np.sin(true_angle)) ** 2
            pose_error += turn * (np.cos(angle) - np.cos(true_angle)) ** 2
            rate_error += velocity * ((vx - tvx) ** 2 + (vy - tvy) ** 2)
            rate_error += spin * (w - tw) ** 2
        if pose_seen[t, push]:
            poses.append(pose_error)
        if rate_seen[t, push]:
            rates.append(rate_error)
    return sum(poses) / max(len(poses), 1) + sum(rates) / max(len(rates), 1)


@pytest.mark.parametrize("seed", [0, 1])
def test_the_loss_is_the_papers(seed):
    case = random_case(seed)
    wanted = [plain_loss(case, push) for push in range(PUSHES)]
    np.testing.assert_allclose(loss_of(*case), wanted, rtol=1e-5)


def test_large_losses_count_linearly_on_request():
    """Squares near zero; far out the loss grows by twice the limit times the error."""
    case = random_case()
    weights = replace(WEIGHTS, linear_from=0.5)
    small = [0.01 * each for each in case[:3]]
    for scaled in (small, case[:3]):
        told = jnp.asarray(scaled[0], jnp.float32), as_target(*scaled[1:], *case[3:])
        squares = np.asarray(push_losses(*told, WEIGHTS))
        found = np.asarray(push_losses(*told, weights))
        np.testing.assert_allclose(
            found, 0.5 * (np.sqrt(1 + squares / 0.25) - 1), rtol=1e-4
        )
        assert np.all(found <= squares)
        # What is left of the series after the square is at most its next term; the
        # root of nearly 1 is known to an epsilon of 1.
        rounding = np.finfo(np.float32).eps
        assert np.all(squares - found <= squares**2 / (4 * 0.5**2) + rounding)


def test_a_full_rotation_has_zero_loss():
    predicted, pose, rate, *seen = random_case()
    predicted[..., :3], predicted[..., 3:] = pose, rate
    predicted[..., 2] += 2 * np.pi
    np.testing.assert_allclose(loss_of(predicted, pose, rate, *seen), 0, atol=1e-10)


def test_unobserved_values_have_no_effect_even_nan():
    predicted, pose, rate, pose_seen, rate_seen = random_case()
    pose_seen[:, 1], rate_seen[:, 2] = False, False
    hidden = pose.copy(), rate.copy()
    hidden[0][~pose_seen], hidden[1][~rate_seen] = np.nan, np.nan
    gradient = jax.jit(jax.value_and_grad(lambda x, *t: loss_of(x, *t).sum()))
    plain = gradient(predicted, pose, rate, pose_seen, rate_seen)
    masked = gradient(predicted, *hidden, pose_seen, rate_seen)
    np.testing.assert_array_equal(masked[0], plain[0])
    np.testing.assert_array_equal(masked[1], plain[1])
    # Nothing pulls at a step that was not observed, and something at all others.
    pull = np.abs(np.asarray(masked[1])).max(-1).max(-1)
    np.testing.assert_array_equal(pull > 0, pose_seen | rate_seen)
    assert np.isfinite(masked[1]).all()


def test_a_push_without_any_observation_has_no_loss():
    predicted, pose, rate, pose_seen, rate_seen = random_case()
    none = np.zeros_like(pose_seen)
    np.testing.assert_array_equal(loss_of(predicted, pose, rate, none, none), 0)
