"""Work spread over JAX's devices gives what one device gives."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from sainet.engines.devices import BATCH, batch_mesh, over_devices


def scaled(shared, batch, more):
    return {"product": shared["factor"] * batch, "sum": more.sum(axis=-1)}


def test_tests_run_on_two_devices():
    assert jax.device_count() == 2
    assert batch_mesh().shape == {BATCH: 2}


@pytest.mark.parametrize("most", [None, 1, 3])
@pytest.mark.parametrize("size", [1, 2, 5, 8])
def test_any_batch_size_is_split_and_joined(size, most):
    batch = jnp.arange(size, dtype=jnp.float32)
    more = jnp.ones((size, 3)) * batch[:, None]
    shared = {"factor": jnp.asarray(2.0)}
    found = over_devices(scaled, shared, batch, more, most=most)
    np.testing.assert_array_equal(found["product"], 2 * np.arange(size))
    np.testing.assert_array_equal(found["sum"], 3 * np.arange(size))


def test_both_devices_compute():
    seen = over_devices(_device_of_each, {}, jnp.zeros(4))
    np.testing.assert_array_equal(seen, [0, 0, 1, 1])


def test_a_device_computes_a_few_rows_at_a_time():
    seen = over_devices(_rows_at_once, {}, jnp.zeros(10), most=2)
    np.testing.assert_array_equal(seen, [2] * 10)


def _rows_at_once(shared, batch):
    return jnp.full(batch.shape, batch.shape[0])


def _device_of_each(shared, batch):
    return jnp.full(batch.shape, jax.lax.axis_index(BATCH))
