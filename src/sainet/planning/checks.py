"""Checks of the inputs of a planner, and warnings about its plans."""

from collections.abc import Iterator, Sequence

import equinox as eqx
import numpy as np

from sainet.models.dynamics import AbstractDynamics
from sainet.models.push_inputs import untrained
from sainet.runs.errors import BadScene
from sainet.scenes.pushes import Push
from sainet.scenes.scene import Scene, pair_gaps
from sainet.scenes.state import State, check_state

_DEEPEST_OVERLAP = 5e-3  # m, of measured poses; more cannot be camera noise
_APART = 5e-3  # m, gap that counts as apart: networks are trained on touching disks
_compiled_gaps = eqx.filter_jit(pair_gaps)


def check_observation(scene: Scene, state: State) -> float:
    """Return the smallest gap between two disks (m), infinite for a single disk.

    Raises:
        BadScene: the observation is not finite, or disks overlap.
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
