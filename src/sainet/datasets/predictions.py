"""Simulator predictions (s-bar) of stored pushes: read where stored, else computed."""

from collections.abc import Sequence
from dataclasses import replace

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from sainet.datasets.batch import (
    PushBatch,
    check_finite,
    from_trajectory,
    to_controls,
    to_initial,
    to_scene,
)
from sainet.datasets.schema import Arrays, StoreInfo, simulated_name
from sainet.engines.base import roll_out
from sainet.engines.simulator import InternalEngine, SimulatorSpec


def simulate(
    simulator: SimulatorSpec, arrays: Arrays, info: StoreInfo, pushes: Sequence[str]
) -> Float[np.ndarray, "push time body 6"]:
    """Return s-bar: packed motion that a simulator predicts.

    Args:
        simulator: predicts.
        arrays: scenes, starts and controls of some pushes, by variable name.
        info: of their store.
        pushes: names of the pushes in messages.

    Raises:
        Diverged: the engine produced NaN or infinity.
        MissingExtra: it needs a package that is not installed.
    """
    motion = _predict(InternalEngine(simulator), arrays, info)
    check_finite(simulator.slug, motion, pushes)
    return motion


def is_stored(internal: InternalEngine, info: StoreInfo) -> bool:
    """Return whether a store contains the prediction of an internal engine."""
    return not internal.camera and internal.simulator.slug in info.assumed_engines


def add_prediction(
    internal: InternalEngine, arrays: Arrays, info: StoreInfo
) -> tuple[Arrays, str]:
    """Return arrays with the prediction of an internal engine, and its name there."""
    slug = internal.simulator.slug
    name = simulated_name(slug)
    if name in arrays:
        return arrays, slug
    return arrays | {name: _predict(internal, arrays, info)}, slug


def as_measured(internal: InternalEngine, batch: PushBatch) -> PushBatch:
    """Return the batch with the pusher where the camera would measure it."""
    if not internal.camera:
        return batch
    offset = jnp.array(internal.camera.vector)
    return replace(
        batch,
        initial=batch.initial.with_pusher_moved(offset),
        controls=batch.controls.moved(offset),
    )


def _predict(
    internal: InternalEngine, arrays: Arrays, info: StoreInfo
) -> Float[np.ndarray, "push time body 6"]:
    initial, controls = to_initial(arrays), to_controls(arrays, info)
    if internal.camera:
        offset = jnp.array(internal.camera.vector)
        initial = initial.with_pusher_moved(offset)
        controls = controls.moved(offset)
    scene = to_scene(arrays, info)
    trajectory = roll_out(internal.simulator.build(), scene, initial, controls)
    return from_trajectory(trajectory)[0]
