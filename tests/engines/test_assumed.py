"""Engines with the paper's assumed properties, whatever the scene."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest

from contracts.worlds import far_away, moving, pushed
from sainet.datasets.config import GenerateConfig
from sainet.engines import make_engine
from sainet.engines.base import AssumedProperties, roll_out
from sainet.engines.planar.engine import PlanarEngine
from sainet.engines.simulator import SIMULATORS, TRUE_PROPERTIES, Assumptions
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


def overlap_of(scene, position):
    """How far the assumed disks of clusters of three are in each other (m), by step."""
    radius = AssumedProperties(PlanarEngine()).assume(scene).radius[:, None]
    pairs = np.array([[0, 1], [0, 2], [1, 2]])
    first, second = (position[..., pairs[:, side], :] for side in (0, 1))
    sums = radius[..., pairs].sum(axis=-1)
    return sums - np.linalg.norm(first - second, axis=-1)


def test_disks_that_overlap_stay_so_or_are_moved_apart():
    scene, initial, _ = pushed(GenerateConfig(disks=3, pushes=20), 0, 1)
    deep = overlap_of(scene, initial.position[:, None]).max(axis=(1, 2)) > 1e-3
    assert 5 < deep.sum() < 20
    start = moving(initial.position, np.zeros_like(initial.position))

    def travel(name):
        simulator = SIMULATORS[name].build()
        end = roll_out(simulator, scene, start, far_away(20, 60)).final
        return np.linalg.norm(end.position - start.position, axis=-1).max(axis=-1)

    assert travel("planar")[deep].min() > 3e-4
    assert travel("planar-overlap").max() < 1e-7


def test_pushed_disks_do_not_sink_further_into_each_other():
    push = pushed(GenerateConfig(disks=3, pushes=20), 0, 200)
    states = roll_out(SIMULATORS["planar-overlap"].build(), *push).states
    scene, initial, _ = push
    start = overlap_of(scene, initial.position[:, None])
    later = overlap_of(scene, states.position)
    assert np.all(later < np.maximum(start, 0) + 3e-4)
    travel = np.linalg.norm(states.position[:, -1] - initial.position, axis=-1)
    assert travel.max() > 0.01
