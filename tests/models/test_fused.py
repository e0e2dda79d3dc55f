"""The kernels of a GPU, interpreted: they predict and differentiate as a scan does."""

from dataclasses import replace
from functools import partial

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from sainet.datasets.batch import to_batch
from sainet.datasets.config import GenerateConfig
from sainet.datasets.generate import simulate_chunk, store_info
from sainet.learning import batches
from sainet.learning.step import trained_layers, with_layers
from sainet.models.correctors import Start
from sainet.models.correctors.fused.arithmetic import bound_gradient
from sainet.models.correctors.fused.unroll import fits, unroll_fused
from sainet.models.correctors.interaction import InteractionNetwork
from sainet.models.correctors.network import Scales, unroll
from sainet.models.features import feature_set
from sainet.models.inputs import push_frame
from sainet.models.integrators import GRADIENT_SIZES, RelaxingResidual
from sainet.models.integrators import bound_gradient as bound_of_scan

STEPS, PUSHES = 6, 11  # a block and a part of one
STEP = 0.2  # s, so long that motion feeds back
FORMS = (
    ("robot", True, "paper"),
    ("robot", False, "paper"),
    ("direct-force", True, "letter"),
    ("robot", True, "unbounded"),
)
interpreted = partial(unroll_fused, interpret=True)


def network_of(kind, simulator, name, **settings):
    features = feature_set(kind, simulator=simulator, name=name)
    rng = np.random.default_rng(0)

    def draw(size, low=0.5):
        return jnp.asarray(rng.uniform(low, 1.5, size), jnp.float32)

    scales = Scales(
        pair_mean=draw(features.pair_size, -0.5) / 100,
        pair_deviation=draw(features.pair_size) / 10,
        body_mean=draw(features.body_size, -0.5) / 100,
        body_deviation=draw(features.body_size) / 10,
        acceleration=draw(3),
    )
    key = jax.random.key(1)
    return InteractionNetwork(
        features, time_step=STEP, key=key, scales=scales, **settings
    )


@pytest.fixture(scope="module")
def batch_of():
    def batch(kind):
        config = GenerateConfig(
            setup=kind, pushes=PUSHES, chunk_size=PUSHES, gap_mm=-1.0
        )
        arrays = simulate_chunk(config, 0)
        info = store_info(config)
        return to_batch(arrays, info, steps=STEPS, simulated="planar")

    return batch


def path(layers, network, batch, how):
    network, initial = with_layers(network, layers), batch.initial
    start = Start(initial, push_frame(batch.scene, initial), initial)
    simulated = batch.simulated if network.features.has_simulator else None
    return network.in_frame(batch.scene, start, batch.controls, simulated, unroll=how)


def weighted(layers, network, batch, how):
    found = path(layers, network, batch, how)
    weights = np.random.default_rng(2).normal(size=found.shape)
    return jnp.sum(found * jnp.asarray(weights, found.dtype)), found


@pytest.mark.parametrize(("kind", "simulator", "name"), FORMS)
@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_kernels_predict_as_the_scan_does(batch_of, kind, simulator, name):
    network, batch = network_of(kind, simulator, name), batch_of(kind)
    assert fits(network, 2)
    layers = trained_layers(network)
    results = [
        jax.jit(
            partial(jax.value_and_grad(weighted, has_aux=True), how=how),
        )(layers, network, batch)
        for how in (unroll, interpreted)
    ]
    ((_, wanted), slope), ((_, found), slope_found) = results
    np.testing.assert_allclose(found, wanted, rtol=1e-5, atol=1e-6)
    for x, y in zip(jax.tree.leaves(slope), jax.tree.leaves(slope_found), strict=True):
        assert float(jnp.abs(x).max()) > 0 or x.size == 0
        np.testing.assert_allclose(y, x, rtol=1e-3, atol=1e-5 * float(jnp.abs(x).max()))


def test_several_networks_pass_through_the_kernels_at_once(batch_of):
    batch, network = batch_of("robot"), network_of("robot", True, "paper")
    layers = trained_layers(network)
    others = jax.tree.map(lambda x: jnp.stack([x, 0.5 * x]), layers)
    both = jax.vmap(lambda each: path(each, network, batch, interpreted))(others)
    for number in range(2):
        one = jax.tree.map(lambda x, i=number: x[i], others)
        wanted = path(one, network, batch, interpreted)
        np.testing.assert_allclose(both[number], wanted, rtol=1e-5, atol=1e-6)


@pytest.mark.parametrize("size", [1e-3, 1.0, 1e3, 1e18, np.nan, np.inf])
def test_gradients_are_bounded_alike(size):
    rng = np.random.default_rng(3)
    slope = rng.normal(size=(6, 2, 8)).astype(np.float32)
    slope[:, 0, 2] *= np.float32(size)
    _, back = jax.vjp(bound_of_scan, jnp.zeros((6, 2, 8)))
    wanted = np.asarray(back(jnp.asarray(slope))[0]).reshape(6, 16)
    sizes = np.zeros((16, 16), np.float32)
    sizes[:6] = np.array(GRADIENT_SIZES, np.float32)[:, None]
    columns = np.zeros((16, 16), np.float32)
    columns[:6] = slope.reshape(6, 16)
    found = bound_gradient(jnp.asarray(columns), jnp.asarray(sizes))
    np.testing.assert_allclose(found[:6], wanted, rtol=1e-5, atol=1e-7)


def test_what_the_kernels_cannot_do_is_left_to_the_scan():
    network = network_of("robot", True, "paper")
    assert not fits(network, 3)
    assert not fits(network_of("robot", True, "place"), 2)
    additive = network_of("robot", True, "paper", integrator=RelaxingResidual())
    assert not fits(additive, 2)


def test_a_push_that_overflows_does_not_reach_the_others(batch_of):
    network, batch = network_of("robot", True, "paper"), batch_of("robot")
    layers = trained_layers(network)
    wanted = path(layers, network, batch, interpreted)
    rate = batch.initial.velocity.at[3].set(1e38)
    broken = replace(
        batch, initial=eqx.tree_at(lambda state: state.velocity, batch.initial, rate)
    )
    found = path(layers, network, broken, interpreted)
    others = np.delete(np.arange(PUSHES), 3)
    np.testing.assert_array_equal(found[:, others], wanted[:, others])


def test_training_uses_the_kernels_on_a_gpu_if_jax_has_what_they_need(monkeypatch):
    network = network_of("robot", True, "paper")
    assert batches._unroll(network, 2, 1) is None  # on a CPU
    monkeypatch.setattr(batches, "is_one_gpu", lambda: True)
    assert batches._unroll(network, 2, 1) is unroll_fused
    assert batches._unroll(network, 3, 1) is None

    def missing(name):
        raise ImportError(name)

    monkeypatch.setattr(batches, "import_module", missing)
    assert batches._unroll(network, 2, 1) is None
