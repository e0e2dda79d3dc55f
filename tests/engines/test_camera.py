"""An engine for a camera that sees things elsewhere than the robot has them."""

import jax.numpy as jnp
import numpy as np
import pytest

from contracts.worlds import pushed
from sainet.datasets.config import GenerateConfig
from sainet.engines.base import roll_out
from sainet.engines.camera import OffsetCamera
from sainet.engines.planar.engine import PlanarEngine
from sainet.pushes import ForceControls, move_pusher
from sainet.scene import pack_motion

PUSHES, STEPS = 4, 60
SETUPS = ("robot", "direct-force")


def world(setup):
    return pushed(GenerateConfig(setup=setup, disks=1, pushes=PUSHES), 0, STEPS)


@pytest.mark.parametrize("setup", SETUPS)
def test_no_offset_changes_no_bit(setup):
    scene, initial, controls = world(setup)
    plain = roll_out(PlanarEngine(), scene, initial, controls)
    found = roll_out(OffsetCamera(PlanarEngine(), 0.0, 0.0), scene, initial, controls)
    np.testing.assert_array_equal(pack_motion(found.states), pack_motion(plain.states))


@pytest.mark.parametrize("setup", SETUPS)
def test_moving_the_whole_scene_back_undoes_the_offset(setup):
    """A disk that the camera sees 2 mm further is 2 mm nearer to the robot."""
    scene, initial, controls = world(setup)
    offset = jnp.array([2e-3, -1e-3])
    plain = roll_out(PlanarEngine(), scene, initial, controls)
    # What the camera tells of it: the disks elsewhere, the pusher where it is.
    told = initial.__class__(
        **vars(initial) | {"position": initial.position + offset[None, None]}
    )
    if isinstance(controls, ForceControls):
        _, controls = move_pusher(told, controls, -offset)
    engine = OffsetCamera(PlanarEngine(), 2.0, -1.0)
    found = roll_out(engine, scene, told, controls)
    seen = np.asarray(found.states.position) - np.asarray(offset)
    np.testing.assert_allclose(seen, plain.states.position, atol=2e-6)
    np.testing.assert_allclose(found.states.angle, plain.states.angle, atol=2e-5)
    np.testing.assert_allclose(
        found.states.pusher_position, plain.states.pusher_position, atol=2e-6
    )
