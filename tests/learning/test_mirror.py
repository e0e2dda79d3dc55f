"""Mirrored pushes are pushes: the engine moves them as it moves the others."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from learning.stores import info_of, made_up, quiet_store, single, write
from sainet.datasets.batch import to_batch
from sainet.engines.planar.engine import PlanarEngine
from sainet.learning.batches import mirror, mirror_some
from sainet.learning.recipes import PAPER
from sainet.learning.task import Task
from sainet.models.library import find_internal_engine
from sainet.scenes.state import pack_motion

SOME = jnp.arange(6) % 2 == 0
SIGNS = np.array([1, -1, -1, 1, -1, -1])


@pytest.fixture(scope="module")
def batch(tmp_path_factory):
    store = quiet_store(tmp_path_factory.getbasetemp())
    return to_batch(store.read(slice(0, 6)), store.info, simulated="planar")


def assert_same(one, other):
    for a, b in zip(jax.tree.leaves(one), jax.tree.leaves(other), strict=True):
        np.testing.assert_array_equal(a, b)


def test_the_motion_of_a_mirrored_push_is_mirrored(batch):
    """The oracle is the engine: to what is mirrored it answers the mirrored truth."""
    seen = mirror(batch, SOME)
    found = PlanarEngine().rollout(seen.scene, seen.initial, seen.controls)
    motion = np.asarray(pack_motion(found.states))
    np.testing.assert_allclose(motion[..., :3], seen.truth[..., :3], atol=2e-6)
    moved = np.abs(np.asarray(seen.truth - batch.truth)).max(axis=(1, 2, 3))
    np.testing.assert_array_equal(moved > 1e-5, SOME)


def test_predictions_and_measured_poses_are_mirrored(batch):
    seen = mirror(batch, SOME)
    odd = np.asarray(SOME)
    for name, signs in (
        ("truth", SIGNS),
        ("simulated", SIGNS),
        ("measured", SIGNS[:3]),
    ):
        whole, flipped = np.asarray(getattr(batch, name)), getattr(seen, name)
        np.testing.assert_array_equal(flipped[odd], whole[odd] * signs)
        np.testing.assert_array_equal(flipped[~odd], whole[~odd])
    assert_same(mirror(seen, SOME), batch)
    assert_same(mirror(batch, jnp.zeros(6, bool)), batch)


def test_forces_and_contact_offsets_are_mirrored():
    info = info_of(6, kind="direct-force")
    arrays = made_up(info)
    rng = np.random.default_rng(0)
    arrays |= {"force": rng.normal(size=(6, 12, 2))}
    arrays |= {"contact_offset": rng.normal(size=(6, 2))}
    whole = to_batch(single(arrays), info)
    seen = mirror(whole, jnp.ones(6, bool))
    assert seen.simulated is None
    for name in ("force", "contact_offset"):
        found, wanted = (getattr(each.controls, name) for each in (seen, whole))
        np.testing.assert_array_equal(found, np.asarray(wanted) * [1, -1])


def test_each_iteration_mirrors_half_of_the_pushes(tmp_path):
    info = info_of(90)
    store = write(tmp_path / "data", info, made_up(info))
    arrays = store.read(slice(None))
    recipe = PAPER.changed(mirror=True)
    task = Task("in", store, recipe, find_internal_engine("planar"))

    def mirrored(task, iteration):
        seen = task.to_training_batch(arrays, 12, iteration)
        place = np.asarray(seen.initial.position[:, 0, 1])
        return place != arrays["initial"][:, 0, 1]

    first = mirrored(task, 1)
    assert 0.4 < first.mean() < 0.6
    np.testing.assert_array_equal(first, mirrored(task, 1))
    assert (first != mirrored(task, 2)).any()
    other = replace(task, recipe=recipe.changed(seed=1))
    assert (first != mirrored(other, 1)).any()
    for change in ({"mirror": False}, {"features": "place"}):
        other = recipe.changed(**change)
        assert not mirrored(replace(task, recipe=other), 1).any()
    whole = task.to_batch(arrays, 12)
    assert_same(mirror_some(whole, 0, 1), task.to_training_batch(arrays, 12, 1))
