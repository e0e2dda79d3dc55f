"""Work spread over JAX's devices gives what one device gives."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from sainet.devices import BATCH, batch_mesh, over_devices


def scaled(shared, batch, more):
    return {"product": shared["factor"] * batch, "sum": more.sum(axis=-1)}


def test_tests_run_on_two_devices():
    assert jax.device_count() == 2
    assert batch_mesh().shape == {BATCH: 2}


@pytest.mark.parametrize("size", [1, 2, 5, 8])
def test_any_batch_size_is_split_and_put_together_again(size):
    batch = jnp.arange(size, dtype=jnp.float32)
    more = jnp.ones((size, 3)) * batch[:, None]
    found = over_devices(scaled, {"factor": jnp.asarray(2.0)}, batch, more)
    np.testing.assert_array_equal(found["product"], 2 * np.arange(size))
    np.testing.assert_array_equal(found["sum"], 3 * np.arange(size))


def test_both_devices_take_part():
    seen = over_devices(_device_of_each, {}, jnp.zeros(4))
    np.testing.assert_array_equal(seen, [0, 0, 1, 1])


def _device_of_each(shared, batch):
    return jnp.full(batch.shape, jax.lax.axis_index(BATCH))
