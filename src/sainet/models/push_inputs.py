"""Pushes as inputs of models: their steps, equal leading axes, and their commands."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer

from sainet.runs.errors import BadScene
from sainet.scenes.controls import PathControls
from sainet.scenes.pushes import Push, command_path
from sainet.scenes.quantities import CONTACT_ANGLE, DIRECTION, SPEED, STROKE
from sainet.scenes.scene import TIME_STEP, Scene
from sainet.scenes.state import State
from sainet.worlds.setups import RobotSetup

_USUAL_STEPS = 200  # of a push whose length or speed is traced
_PARAMETERS = {
    "contact_angle": CONTACT_ANGLE,
    "direction": DIRECTION,
    "length": STROKE,
    "speed": SPEED,
}


def is_traced(tree: object) -> bool:
    """Return whether JAX traces any part."""
    return any(isinstance(leaf, Tracer) for leaf in jax.tree.leaves(tree))


def steps_of(push: Push, time_step: float) -> int:
    """Return the steps until every push has ended and the disks rest."""
    for name, quantity in _PARAMETERS.items():
        value = getattr(push, name)
        if not is_traced(value):
            quantity.check(value, f"push: {name}", error=BadScene)
    if is_traced((push.length, push.speed)):
        return _USUAL_STEPS
    # Single-precision numbers as they were meant: 0.05, not 0.0500000007.
    given = np.array([push.length, push.speed], np.float64)
    length, speed = np.round(given.reshape(2, -1), 7)
    steps = RobotSetup().steps(length, speed).max()
    return int(np.ceil(steps * TIME_STEP / time_step - 1e-6))


def _together(scene: Scene, state: State, push: Push) -> tuple[Scene, State, Push]:
    """Return the parts with equal leading axes."""
    parts = (scene, state, push)
    own = scene.batch_shape, state.angle.shape[:-1], push.speed.shape
    try:
        shape = np.broadcast_shapes(*own)
    except ValueError:
        names = ", ".join(map(str, own))
        raise BadScene(
            f"push: the leading axes of scene, state and push are {names}; give equal "
            "ones, or none."
        ) from None

    def widened(part: Any, axes: int) -> Any:  # noqa: ANN401
        return jax.tree.map(lambda x: jnp.broadcast_to(x, shape + x.shape[axes:]), part)

    found = (widened(*pair) for pair in zip(parts, map(len, own), strict=True))
    return tuple(found)


def commanded(
    scene: Scene, state: State, push: Push, steps: int
) -> tuple[Scene, State, PathControls]:
    """Return scene, start and controls of pushes, all with equal leading axes.

    Raises:
        BadScene: the leading axes differ.
    """
    scene, state, push = _together(scene, state, push)
    return scene, *_command(scene, state, push, steps)


@eqx.filter_jit
def _command(
    scene: Scene, state: State, push: Push, steps: int
) -> tuple[State, PathControls]:
    return command_path(scene, state, push, steps=steps)
