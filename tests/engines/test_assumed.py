"""Engines with the paper's assumed properties, whatever the scene."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest

from contracts.worlds import pushed
from sainet.datasets.config import GenerateConfig
from sainet.engines import make_engine
from sainet.engines.base import AssumedProperties, roll_out
from sainet.engines.planar.engine import PlanarEngine
from sainet.engines.simulator import TRUE_PROPERTIES, Assumptions
from sainet.runs.errors import UnknownName
from sainet.scenes.scene import FrictionField


def scene_of(disks: int):
    scene, *_ = pushed(GenerateConfig(disks=disks, pushes=3), 0, 1)
    field = FrictionField(
        wave=jnp.zeros((3, 1, 2)), phase=jnp.zeros((3, 1)), amplitude=jnp.ones(3)
    )
    return eqx.tree_at(
        lambda s: s.friction_field, scene, field, is_leaf=lambda x: x is None
    )


def test_properties_of_the_paper_replace_those_of_the_scene():
    scene = scene_of(4)
    found = AssumedProperties(PlanarEngine()).assume(scene)
    np.testing.assert_allclose(found.mass, [[0.896, 1.1, 0.998, 0.998]] * 3)
    np.testing.assert_allclose(found.radius, [[0.0525, 0.058, 0.05525, 0.05525]] * 3)
    np.testing.assert_allclose(found.table_friction, [0.15] * 3)
    assert found.friction_field is None
    for kept in ("disk_friction", "pusher_friction", "pusher_radius", "time_step"):
        np.testing.assert_array_equal(getattr(found, kept), getattr(scene, kept))


def test_one_disk_takes_the_first_assumed_properties():
    found = AssumedProperties(PlanarEngine()).assume(scene_of(1))
    np.testing.assert_allclose(found.mass, [[0.896]] * 3)


def test_none_keeps_the_scenes_values_but_no_friction_field():
    scene = scene_of(2)
    wrapped = AssumedProperties(PlanarEngine(), Assumptions())
    found = wrapped.assume(scene)
    for kept in ("mass", "radius", "table_friction"):
        np.testing.assert_array_equal(getattr(found, kept), getattr(scene, kept))
    assert found.friction_field is None


def test_true_properties_are_masses_and_radii_and_no_friction():
    scene = scene_of(2)
    found = AssumedProperties(PlanarEngine(), TRUE_PROPERTIES).assume(scene)
    np.testing.assert_array_equal(found.mass, scene.mass)
    np.testing.assert_array_equal(found.radius, scene.radius)
    np.testing.assert_allclose(found.table_friction, [0.15] * 3)


def test_rolls_out_in_the_assumed_scene():
    scene, start, controls = pushed(GenerateConfig(pushes=3), 0, 20)
    wrapped = AssumedProperties(PlanarEngine())
    found = roll_out(wrapped, scene, start, controls).states
    wanted = roll_out(PlanarEngine(), wrapped.assume(scene), start, controls).states
    np.testing.assert_allclose(found.position, wanted.position, atol=1e-7)
    true = roll_out(PlanarEngine(), scene, start, controls).states
    assert np.abs(found.position - true.position).max() > 1e-4


def test_an_unknown_engine_lists_the_available_engines():
    with pytest.raises(
        UnknownName, match="'plannar' .did you mean planar.*Available: .*planar"
    ):
        make_engine("plannar")
