"""What every dynamics model has to obey, behind the one `predict`."""

from functools import lru_cache

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from contracts.transforms import Placement, renumber_scene, renumber_state
from contracts.worlds import first_steps, later_steps, rows, together
from models.samples import PUSHES, STEPS, dynamics, pushes
from sainet.models.dynamics import predict
from sainet.scenes.controls import PathControls
from sainet.scenes.state import State, pack_motion

MODELS = ("physics", "in", "sain")
PLACES = {
    "turned": Placement(turn=2.6),
    "moved": Placement(shift=(0.4, -0.3)),
    "both": Placement(turn=-1.1, shift=(-0.2, 0.5)),
}
every_model = pytest.mark.parametrize("model", MODELS)
every_push = pytest.mark.parametrize(
    ("kind", "bodies"), [("robot", 1), ("robot", 2), ("robot", 3), ("direct-force", 2)]
)
# What needs a compilation of its own is tried on fewer.
some_pushes = pytest.mark.parametrize(
    ("kind", "bodies"), [("robot", 1), ("robot", 3), ("direct-force", 2)]
)
# m; an engine's solver visits the pairs in another order.
SWAP_TOLERANCE = {"physics": 3e-4, "in": 2e-6, "sain": 3e-4}


def order_of(bodies: int) -> list[int]:
    return list(range(bodies))


@lru_cache
def predicted(model: str, kind: str, bodies: int) -> State:
    """The pushes as they are, then at each place, all in one batch."""
    scene, initial, controls = pushes(kind, bodies)
    places = PLACES.values()
    whole = (
        together(*[scene] * (1 + len(places))),
        together(initial, *(place.state(initial) for place in places)),
        together(controls, *(place.controls(controls) for place in places)),
    )
    return predict(dynamics(model, kind, order_of(bodies)), *whole).states


def at(states: State, index: int) -> State:
    return rows(states, slice(index * PUSHES, (index + 1) * PUSHES))


def assert_same(found: State, wanted: State, tolerance: float):
    """Positions agree to a tolerance (m), angles to as much at a rim of 50 mm."""
    for name, lever in (("position", 1), ("angle", 0.05), ("velocity", 1 / 240)):
        gap = lever * np.abs(np.asarray(getattr(found, name)) - getattr(wanted, name))
        assert gap.max() < tolerance, f"{name} differs by {gap.max():.2g}"


@every_push
@every_model
def test_poses_follow_from_velocities(model, kind, bodies):
    _, initial, controls = pushes(kind, bodies)
    states = at(predicted(model, kind, bodies), 0)
    motion = np.asarray(pack_motion(states), np.float64)
    start = np.asarray(pack_motion(initial), np.float64)[:, None]
    before = np.concatenate([start, motion[:, :-1]], axis=1)
    change = (motion - before)[..., :3]
    assert motion.shape == (PUSHES, STEPS, bodies, 6)
    assert np.abs(change).max() > 1e-5
    np.testing.assert_allclose(change, motion[..., 3:] / 240, atol=5e-7)


@every_push
@every_model
def test_moved_and_turned_scenes_move_and_turn_the_prediction(model, kind, bodies):
    states = predicted(model, kind, bodies)
    for index, place in enumerate(PLACES.values(), start=1):
        assert_same(at(states, index), place.state(at(states, 0)), 1e-5)


@pytest.mark.parametrize(("kind", "bodies"), [("robot", 3), ("direct-force", 2)])
@every_model
def test_swapped_disks_swap_the_prediction(model, kind, bodies):
    # Every disk gets another place in the list, the pushed one too: models of several
    # disks must look for the one at the pusher, not take the first.
    order = order_of(bodies)[::-1]
    scene, initial, controls = pushes(kind, bodies)
    swapped = predict(
        dynamics(model, kind, order),
        renumber_scene(scene, order),
        renumber_state(initial, order),
        controls,
    ).states
    plain = at(predicted(model, kind, bodies), 0)
    assert_same(renumber_state(swapped, order), plain, SWAP_TOLERANCE[model])
    assert (
        np.abs(np.asarray(plain.position[:, -1] - swapped.position[:, -1])).max() > 0.01
    )


@some_pushes
@every_model
def test_one_scene_is_a_row_of_the_batch(model, kind, bodies):
    alone = predict(
        dynamics(model, kind, order_of(bodies)), *rows(pushes(kind, bodies), 2)
    ).states
    assert alone.angle.shape == (STEPS, bodies)
    assert_same(alone, rows(predicted(model, kind, bodies), 2), 2e-6)


@some_pushes
@every_model
def test_two_advances_equal_one_long_one(model, kind, bodies):
    scene, initial, controls = pushes(kind, bodies)
    made = dynamics(model, kind, order_of(bodies))

    @eqx.filter_jit
    def twice(made, scene, initial, controls):
        half = STEPS // 2
        carry = made.begin(scene, initial)
        carry, one = made.advance(scene, carry, first_steps(controls, half))
        _, two = made.advance(scene, carry, later_steps(controls, half))
        join = lambda a, b: jnp.concatenate([a, b], axis=1)  # noqa: E731
        return jax.tree.map(join, one, two).states

    halves = twice(made, scene, initial, controls)
    assert_same(halves, at(predicted(model, kind, bodies), 0), 1e-5)


@every_model
def test_the_pusher_is_at_its_command(model):
    _, _, controls = pushes("robot", 2)
    states = at(predicted(model, "robot", 2), 0)
    assert isinstance(controls, PathControls)
    found = np.asarray(states.pusher_position)
    np.testing.assert_allclose(found, controls.position, atol=1e-6)
