"""What an engine is told of recorded pushes, and what it predicts of them: s-bar."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from sainet.datasets.batch import (
    check_finite,
    from_trajectory,
    to_controls,
    to_initial,
    to_scene,
)
from sainet.datasets.schema import StoreInfo
from sainet.engines import make_assumed_engine
from sainet.engines.base import roll_out
from sainet.errors import BadInput

CONTACT_FRICTION = 0.25
TABLE_FRICTION = 0.15  # the paper's; a quasi-static path hardly depends on it


def check_frictions(contact_friction: float, table_friction: float) -> None:
    """Check what the user says of friction.

    Raises:
        BadInput: one is negative or no number.
    """
    # No command has an option for the second: whoever calls from Python set it.
    options = {"--contact-friction": contact_friction, "table_friction": table_friction}
    for name, value in options.items():
        if not 0 <= value < float("inf"):
            raise BadInput(f"{name} is {value}; it must be zero or positive.")


def simulate(
    name: str, arrays: dict[str, np.ndarray], info: StoreInfo, pushes: Sequence[str]
) -> Float[np.ndarray, "push time body 6"]:
    """Return s-bar: what an engine predicts with the properties that it assumes.

    Args:
        name: of the assumed engine.
        arrays: scenes, starts and controls of some pushes, by variable name.
        info: of their store.
        pushes: what their file calls each of them.

    Raises:
        Diverged: the engine left the numbers.
    """
    scene, initial = to_scene(arrays, info), to_initial(arrays)
    engine = make_assumed_engine(name)
    trajectory = roll_out(engine, scene, initial, to_controls(arrays, info))
    motion, _ = from_trajectory(trajectory)
    check_finite(name, motion, pushes)
    return motion
