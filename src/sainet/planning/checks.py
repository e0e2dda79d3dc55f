"""Checks of the inputs of a planner, and warnings about its plans."""

from collections.abc import Iterator, Sequence

import equinox as eqx
import numpy as np
from jaxtyping import Array, Bool

from sainet.models.dynamics import AbstractDynamics
from sainet.models.push_inputs import untrained
from sainet.runs.errors import BadScene
from sainet.scenes.pushes import Push, place_pusher
from sainet.scenes.scene import Scene, pair_gaps, pusher_gaps
from sainet.scenes.state import State, at_rest, check_state

_DEEPEST_OVERLAP = 5e-3  # m, of measured poses; more cannot be camera noise
_APART = 5e-3  # m, gap that counts as apart: networks are trained on touching disks
_compiled_gaps = eqx.filter_jit(pair_gaps)


def check_observation(scene: Scene, state: State) -> float:
    """Return the smallest gap between two disks (m), infinite for a single disk.

    Raises:
        BadScene: the observation is not finite or not of the scene, or disks overlap.
    """
    check_state(state, "observation")
    seen, known = list(np.shape(state.angle)), list(np.shape(scene.mass))
    if seen != known or len(known) != 1:
        raise BadScene(
            f"observation: its angles have the shape {seen}, the scene's masses "
            f"{known}; give one scene, and one pose for each of its disks."
        )
    gap = float(np.min(np.asarray(_compiled_gaps(scene, state)), initial=np.inf))
    if gap < -_DEEPEST_OVERLAP:
        raise BadScene(
            f"observation: two disks overlap by {-1000 * gap:.1f} mm; check the poses "
            "and the radii."
        )
    return gap


def may_lack_room(scene: Scene, pushes: Push) -> bool:
    """Return whether the pusher may start inside a disk: is `has_room` needed?

    Disk 2 is ahead of disk 1, and never in the way of a pusher behind disk 1.
    """
    widest = np.max(np.abs(pushes.contact_angle), initial=0.0)
    return scene.body_count > (1 if widest > np.pi / 2 else 2)


def has_room(scenes: Scene, states: State, pushes: Push) -> Bool[Array, " batch"]:
    """Return whether the pusher starts outside all disks; all share a batch axis."""
    start = place_pusher(scenes, states, pushes)
    initial = at_rest(states.position, states.angle, start)
    return (pusher_gaps(scenes, initial)[..., 1:] >= 0).all(axis=-1)


def doubts(
    dynamics: AbstractDynamics, gap: float, pushes: Sequence[Push]
) -> Iterator[str]:
    """Yield reasons why the prediction of a plan may be inaccurate.

    Args:
        dynamics: model that predicts; physics has no training range.
        gap: smallest gap between two disks at the start, m.
        pushes: planned pushes.
    """
    if dynamics.made_for is None:
        return
    if _APART < gap < np.inf:
        yield (
            f"no two disks are within {1000 * _APART:g} mm of each other: the model "
            "was trained on disks that touch"
        )
    for number, push in enumerate(pushes, start=1):
        yield from (f"push {number}: {doubt}" for doubt in untrained(push))
