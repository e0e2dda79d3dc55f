"""Whose prediction a network sees in training: stored with the pushes, or computed."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import jax.numpy as jnp

from sainet.datasets.batch import (
    PushBatch,
    from_trajectory,
    to_controls,
    to_initial,
    to_scene,
)
from sainet.datasets.schema import Arrays, StoreInfo, simulated_name
from sainet.engines import ASSUMED_ENGINES, make_assumed_engine
from sainet.engines.assumed import AssumedProperties, beliefs
from sainet.engines.base import roll_out
from sainet.engines.identified import (
    IDENTIFIED,
    beliefs_of,
    camera_offset,
    engine_of_beliefs,
    is_identified,
    read_values,
)
from sainet.scenes.controls import move_controls, move_pusher


@dataclass(frozen=True)
class AssumedEngine:
    """An engine with what it believes of the scene."""

    name: str  # as a network's card names it
    beliefs: dict[str, Any]  # as a network's card says them

    @property
    def is_stored(self) -> bool:
        """Whether its prediction is stored with the pushes; else it is computed."""
        return self.name != IDENTIFIED

    def make(self) -> AssumedProperties:
        """Return the engine itself.

        Raises:
            MissingExtra: it needs a package that is not installed.
        """
        if self.is_stored:
            return make_assumed_engine(self.name)
        return engine_of_beliefs(self.beliefs)

    def as_seen(self, batch: PushBatch) -> PushBatch:
        """Return the batch with the pusher where the camera would see it."""
        offset = jnp.array(camera_offset(self.beliefs))
        return replace(
            batch,
            initial=move_pusher(batch.initial, offset),
            controls=move_controls(batch.controls, offset),
        )

    def predict(self, arrays: Arrays, info: StoreInfo) -> Arrays:
        """Return arrays of a store with this engine's prediction, if it lacks them."""
        name = simulated_name(self.name)
        if name in arrays:
            return arrays
        offset = jnp.array(camera_offset(self.beliefs))
        scene = to_scene(arrays, info)
        initial = move_pusher(to_initial(arrays), offset)
        controls = move_controls(to_controls(arrays, info), offset)
        trajectory = roll_out(self.make(), scene, initial, controls)
        return arrays | {name: from_trajectory(trajectory)[0]}


def find_assumed_engine(name: str) -> AssumedEngine:
    """Return an assumed engine by its name, or by the folder it was identified into.

    A name that is neither is that of an engine whose prediction may be stored all the
    same; the data will tell.

    Raises:
        BadInput: the folder holds no such values.
    """
    folder = Path(name)
    if name not in ASSUMED_ENGINES and is_identified(folder):
        return AssumedEngine(IDENTIFIED, beliefs_of(read_values(folder)))
    return AssumedEngine(name, beliefs(name))
