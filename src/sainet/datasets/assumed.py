"""What an assumed engine predicts of stored pushes: s-bar."""

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
from sainet.datasets.schema import Arrays, StoreInfo
from sainet.engines import make_assumed_engine
from sainet.engines.base import roll_out


def simulate(
    name: str, arrays: Arrays, info: StoreInfo, pushes: Sequence[str]
) -> Float[np.ndarray, "push time body 6"]:
    """Return s-bar: what an engine predicts with the properties that it assumes.

    Args:
        name: of the assumed engine.
        arrays: scenes, starts and controls of some pushes, by variable name.
        info: of their store.
        pushes: what the user knows each of them by.

    Raises:
        Diverged: the engine left the numbers.
    """
    scene, initial = to_scene(arrays, info), to_initial(arrays)
    engine = make_assumed_engine(name)
    trajectory = roll_out(engine, scene, initial, to_controls(arrays, info))
    motion, _ = from_trajectory(trajectory)
    check_finite(name, motion, pushes)
    return motion
