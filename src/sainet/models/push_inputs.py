"""Pushes as inputs of models: steps, equal leading axes, commands and predictions."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from sainet.models.dynamics import AbstractDynamics, predict
from sainet.runs.errors import BadScene, require
from sainet.scenes import quantities
from sainet.scenes.controls import Controls, PathControls
from sainet.scenes.pushes import Push, PushGrid, check_push, command_path
from sainet.scenes.scene import TIME_STEP, Scene, check_axes_of, check_scene
from sainet.scenes.state import (
    State,
    Trajectory,
    check_shapes,
    check_state,
    is_traced,
    require_shapes,
)
from sainet.worlds.setups import RobotSetup

_USUAL_STEPS = 200  # of pushes whose length or speed is traced, and of no push
_PARTS = {
    "scene": (Scene, "a Scene, for example of Scene.disks"),
    "state": (State, "a State, for example of scene.in_a_row() or at_rest"),
    "push": ((Push, Controls), "a Push, for example Push(0.2), or Controls"),
}
# Of controls, by the names of their fields.
_RANGES = {
    "position": quantities.POSITION,
    "velocity": quantities.VELOCITY,
    "force": quantities.FORCE,
    "contact_offset": quantities.POSITION,
}
_SLACK = 1e-3  # relative tolerance of the training range


def check_parts(scene: Scene, state: State, push: Push | Controls) -> None:
    """Raise `BadInput` unless scene, state and push are such objects and possible.

    Traced numbers are not checked, nor here parameters of a `Push`.
    """
    parts = zip((scene, state, push), _PARTS.items(), strict=True)
    for given, (name, (kind, wanted)) in parts:
        is_kind = isinstance(given, kind)  # pyright: ignore
        require(is_kind, name, wanted, given)
    check_axes_of(scene)
    check_shapes(state)
    if not isinstance(push, Push):
        _check_controls(push)
    if not is_traced(scene):
        check_scene(scene)
    if not is_traced(state):
        check_state(state)


def _check_controls(controls: Controls) -> None:
    axes = np.shape(controls.command)[:-1]
    if not axes:
        raise BadScene("push: its controls have no axis, time; give [time, 2].")
    for name, quantity in _RANGES.items():
        if (values := getattr(controls, name, None)) is not None:
            own = axes[:-1] if name == "contact_offset" else axes
            require_shapes(controls, "push", {name: (*own, 2)})
            if not is_traced(values):
                quantity.check(values, f"push: {name}", error=BadScene)


def untrained(push: Push, *names: str) -> list[str]:
    """Return a sentence for each parameter of pushes outside the paper's range.

    Args:
        push: one push or several, not traced.
        names: of parameters; none: all.
    """
    usual, wide = PushGrid(), 1 + _SLACK
    outside = {
        "contact angle": np.abs(push.contact_angle) > wide * usual.contact_range,
        "direction": np.abs(push.direction) > wide * usual.direction_range,
        "length": np.abs(push.length / usual.length - 1) > _SLACK,
        "speed": np.abs(push.speed / usual.speed - 1) > _SLACK,
    }
    found = [name for name in names or outside if np.any(outside[name])]
    return [f"its {name} is outside the model's training range" for name in found]


def steps_of(push: Push, time_step: float) -> int:
    """Return the steps until every push has ended and the disks rest."""
    check_push(push)
    if is_traced((push.length, push.speed)) or not push.length.size:
        return _USUAL_STEPS
    # Single-precision numbers as they were meant: 0.05, not 0.0500000007.
    length, speed = np.array([push.length, push.speed], float).reshape(2, -1).round(7)
    steps = RobotSetup().steps(length, speed).max()
    return int(np.ceil(steps * TIME_STEP / time_step - 1e-6))


def kind_of(push: Push | Controls) -> str:
    """Return the setup that a push or controls are for."""
    return PathControls.kind if isinstance(push, Push) else push.kind


def check_axes(scene: Scene, state: State, push: Push | Controls) -> None:
    """Raise `BadScene` for unequal leading axes, or controls that have no steps."""
    if not (isinstance(push, Push) or push.steps):
        raise BadScene("push: the controls have no steps; give at least one.")
    names = ", ".join(map(str, _axes(scene, state, push)))
    if max(map(len, _axes(scene, state, push))) > 1:
        raise BadScene(
            f"push: the leading axes of scene, state and push are {names}; give one "
            "axis, push, or apply `jax.vmap` for each further one."
        )
    try:
        np.broadcast_shapes(*_axes(scene, state, push))
    except ValueError:
        raise BadScene(
            f"push: the leading axes of scene, state and push are {names}; give equal "
            "ones, or none."
        ) from None


def _axes(
    scene: Scene, state: State, push: Push | Controls
) -> tuple[tuple[int, ...], ...]:
    own = push.speed.shape if isinstance(push, Push) else push.command.shape[:-2]
    return scene.batch_shape, state.angle.shape[:-1], own


def widened(scene: Scene, state: State, push: Push | Controls) -> tuple[Any, ...]:
    """Return the three, each with the leading axes and in the precision of all."""
    own, parts = _axes(scene, state, push), (scene, state, push)
    shape, kind = np.broadcast_shapes(*own), jnp.result_type(*jax.tree.leaves(parts))

    def widen(part: Any, axes: int) -> Any:  # noqa: ANN401
        as_wide = lambda x: jnp.broadcast_to(x, shape + x.shape[axes:])  # noqa: E731
        return jax.tree.map(lambda x: as_wide(x).astype(kind), part)

    return tuple(map(widen, parts, map(len, own)))


def predict_push(
    dynamics: AbstractDynamics, scene: Scene, state: State, push: Push, steps: int
) -> Trajectory:
    """Return the predicted motion of pushes, with the leading axes of all parts."""
    scene, state, push = widened(scene, state, push)
    initial, controls = command_path(scene, state, push, steps=steps)
    # Networks reshape, which an axis of no pushes does not allow.
    if 0 in scene.batch_shape:
        return Trajectory(
            jax.tree.map(lambda x: jnp.zeros((0, steps, *x.shape[1:])), initial)
        )
    return predict(dynamics, scene, initial, controls)


compiled = eqx.filter_jit(predict_push)
