"""Models with a camera offset."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest

from contracts.worlds import pushed
from models.samples import network
from sainet.datasets.config import GenerateConfig
from sainet.engines.base import AssumedProperties
from sainet.engines.planar.engine import PlanarEngine
from sainet.models.dynamics import PhysicsDynamics, SimulatorAugmented, predict
from sainet.models.wrappers import OffsetCamera, with_camera
from sainet.scenes.controls import PathControls
from sainet.scenes.recording import CameraOffset
from sainet.scenes.state import pack_motion

STEPS = 40
OFFSET = CameraOffset(x=2e-3, y=-1e-3)


def model_of(name, setup):
    if name == "physics":
        return PhysicsDynamics(PlanarEngine())
    return SimulatorAugmented(network("sain", setup), AssumedProperties(PlanarEngine()))


def world(setup):
    return pushed(GenerateConfig(setup=setup, disks=2, pushes=4), 0, STEPS)


@pytest.mark.parametrize("setup", ["robot", "direct-force"])
@pytest.mark.parametrize("name", ["physics", "sain"])
def test_predictions_equal_those_in_robot_coordinates(name, setup):
    model = model_of(name, setup)
    scene, initial, controls = world(setup)
    plain = predict(model, scene, initial, controls)
    # In camera coordinates the disks move; the pusher stays.
    offset = jnp.array(OFFSET.vector)
    told = eqx.tree_at(
        lambda s: s.position, initial, initial.position + offset[None, None]
    )
    if controls.pusher_path is None:  # measured from the displaced disk
        contact = controls.contact_offset - offset[None]
        controls = eqx.tree_at(lambda c: c.contact_offset, controls, contact)
    found = predict(OffsetCamera(model, OFFSET), scene, told, controls)
    np.testing.assert_allclose(
        np.asarray(found.states.position) - np.asarray(offset),
        plain.states.position,
        atol=5e-6,
    )
    for part in ("angle", "velocity", "spin", "pusher_position"):
        np.testing.assert_allclose(
            getattr(found.states, part), getattr(plain.states, part), atol=2e-3
        )


def test_two_advances_equal_a_long_advance():
    model = OffsetCamera(model_of("sain", "robot"), OFFSET)
    scene, initial, controls = world("robot")
    whole = predict(model, scene, initial, controls)
    carry, parts = model.begin(scene, initial), []
    for part in (slice(0, 15), slice(15, None)):
        some = PathControls(controls.position[:, part], controls.velocity[:, part])
        carry, trajectory = model.advance(scene, carry, some)
        parts.append(np.asarray(pack_motion(trajectory.states)))
    found = np.concatenate(parts, axis=1)
    np.testing.assert_allclose(found, pack_motion(whole.states), atol=2e-5)


def test_the_engine_alone_has_the_camera_too():
    model = model_of("sain", "robot")
    alone = with_camera(model, OFFSET).engine_alone
    assert eqx.tree_equal(alone, OffsetCamera(PhysicsDynamics(model.engine), OFFSET))
    assert with_camera(model_of("physics", "robot"), OFFSET).engine_alone is None


def test_a_zero_camera_offset_adds_no_wrapper():
    model = model_of("in", "robot")
    assert with_camera(model, CameraOffset()) is model
    found = with_camera(model, CameraOffset(x=1.5e-3))
    assert found.offset.vector == (1.5e-3, 0.0)
