"""What cannot be planned from, and what makes a plan worth less."""

from collections.abc import Iterator, Sequence

import equinox as eqx
import numpy as np

from sainet.models.dynamics import AbstractDynamics
from sainet.runs.errors import BadCheckpoint, BadScene
from sainet.scenes.controls import PathControls
from sainet.scenes.pushes import Push, PushGrid
from sainet.scenes.scene import Scene
from sainet.scenes.shapes import pair_gaps
from sainet.scenes.state import State, check_state

_DEEPEST_OVERLAP = 5e-3  # m, of disks that were seen; more is no noise of a camera
_APART = 5e-3  # m: networks are trained on disks that touch
_SAME_TIME = 1e-9  # s
_SLACK = 1e-3  # of a push, relative
_compiled_gaps = eqx.filter_jit(pair_gaps)


def check_model(dynamics: AbstractDynamics, scene: Scene) -> None:
    """Raise `BadCheckpoint` if a network was made for another step or other controls.

    It would predict something, and nobody would see that it is wrong.
    """
    made_for = dynamics.made_for
    if made_for is None:
        return
    if made_for.kind != PathControls.kind:
        raise BadCheckpoint(
            f"model: its network is for {made_for.kind} pushes, planners push along "
            f"paths; train one with: sainet generate {PathControls.kind}"
        )
    if abs(made_for.time_step - scene.time_step) > _SAME_TIME:
        raise BadCheckpoint(
            f"model: its network is for steps of {made_for.time_step:g} s, the scene's "
            f"are {scene.time_step:g} s; give the scene that time step."
        )


def check_observation(scene: Scene, state: State) -> float:
    """Return the least gap between two disks (m), infinite if there is but one.

    Raises:
        BadScene: nothing can be planned from what was observed.
    """
    check_state(state, "observation")
    gap = float(np.min(np.asarray(_compiled_gaps(scene, state)), initial=np.inf))
    if gap < -_DEEPEST_OVERLAP:
        raise BadScene(
            f"observation: two disks overlap by {-1000 * gap:.1f} mm; check the poses "
            "and the radii."
        )
    return gap


def doubts(
    dynamics: AbstractDynamics, gap: float, pushes: Sequence[Push]
) -> Iterator[str]:
    """Yield why the prediction of a plan may be worth less than usual.

    Args:
        dynamics: what predicts; an engine alone is as good anywhere.
        gap: the least between two disks at the start, m.
        pushes: the planned ones.
    """
    if dynamics.made_for is None:
        return
    if _APART < gap < np.inf:
        yield (
            f"no two disks are within {1000 * _APART:g} mm of each other: networks "
            "were trained on disks that touch"
        )
    for number, push in enumerate(pushes, start=1):
        for name in _beyond_training(push):
            yield f"push {number}: its {name} is none that networks were trained on"


def _beyond_training(push: Push) -> list[str]:
    """Return what of a push lies outside of the paper's pushes."""
    usual = PushGrid()
    wide = 1 + _SLACK
    outside = {
        "contact angle": abs(float(push.contact_angle)) > wide * usual.contact_range,
        "direction": abs(float(push.direction)) > wide * usual.direction_range,
        "length": abs(float(push.length) / usual.length - 1) > _SLACK,
        "speed": abs(float(push.speed) / usual.speed - 1) > _SLACK,
    }
    return [name for name, is_outside in outside.items() if is_outside]
