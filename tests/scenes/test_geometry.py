"""Angles and frames."""

import jax
import jax.numpy as jnp
import numpy as np

from sainet.scenes.geometry import direction, norm, rotate, unit, wrap_angle

ANGLES = jnp.linspace(-3.1, 3.1, 25)


def test_units_have_length_one_and_their_direction():
    np.testing.assert_allclose(norm(unit(ANGLES)), 1, rtol=1e-6)
    np.testing.assert_allclose(direction(unit(ANGLES)), ANGLES, atol=1e-6)


def test_rotation_is_counter_clockwise_and_invertible():
    x = jnp.array([1.0, 0.0])
    np.testing.assert_allclose(rotate(x, jnp.asarray(jnp.pi / 2)), [0, 1], atol=1e-7)
    vectors = jnp.stack([ANGLES, 2 - ANGLES], -1)
    np.testing.assert_allclose(
        rotate(rotate(vectors, ANGLES), -ANGLES), vectors, atol=1e-5
    )
    np.testing.assert_allclose(
        rotate(unit(ANGLES), ANGLES), unit(2 * ANGLES), atol=1e-6
    )


def test_the_norm_of_zero_has_zero_gradient():
    np.testing.assert_array_equal(jax.grad(norm)(jnp.zeros(2)), [0, 0])
    np.testing.assert_allclose(jax.grad(norm)(jnp.array([3.0, 4.0])), [0.6, 0.8])
    assert float(norm(jnp.array([3.0, 4.0]))) == 5
    assert jnp.isnan(norm(jnp.array([jnp.nan, 4.0])))


def test_wrapped_angles_are_equal_directions_within_a_turn():
    angles = jnp.linspace(-20, 20, 81)
    wrapped = wrap_angle(angles)
    assert (wrapped >= -jnp.pi).all()
    assert (wrapped < jnp.pi).all()
    np.testing.assert_allclose(unit(wrapped), unit(angles), atol=1e-5)
    exact = wrap_angle(np.array([np.pi, -np.pi, 7.0]))  # in NumPy's precision
    np.testing.assert_allclose(exact, [-np.pi, -np.pi, 7.0 - 2 * np.pi], rtol=1e-14)
