"""Batches as training uses them: predicted, some mirrored, or cut into steps."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from importlib import import_module

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from sainet.datasets.batch import PushBatch
from sainet.engines.base import AbstractEngine
from sainet.engines.devices import is_one_gpu
from sainet.models.correctors import Start
from sainet.models.correctors.held import unroll_held
from sainet.models.correctors.network import AbstractNetwork
from sainet.models.inputs import push_frame
from sainet.scenes.state import State, pack_motion, unpack_motion

_STREAM = 0x318808
_POSE = (1.0, -1.0, -1.0)


def mirror_some(batch: PushBatch, seed: int, iteration: int) -> PushBatch:
    """Return the batch with about half of its pushes mirrored; drawn by the iteration.

    Scenes stay: a stored push has no field of friction.
    """
    rng = np.random.default_rng([_STREAM, seed, iteration])
    return mirror(batch, jnp.asarray(rng.random(batch.size) < 1 / 2))


@jax.jit  # of a hundred small operations
def mirror(batch: PushBatch, chosen: Bool[Array, " push"]) -> PushBatch:
    """Return the batch with the chosen pushes mirrored at the x axis of the table."""

    def flip(values: Array) -> Array:
        poses = np.resize(_POSE, values.shape[-1])  # and their rates, if packed motion
        return values * poses.astype(values.dtype).reshape(
            (1,) * (values.ndim - 1) + (-1,)
        )

    def choose(mirrored: Array, values: Array) -> Array:
        return jnp.where(chosen.reshape(-1, *[1] * (values.ndim - 1)), mirrored, values)

    arrays = ("truth", "measured", "simulated")
    mirrored = {name: jax.tree.map(flip, getattr(batch, name)) for name in arrays}
    mirrored |= {
        "initial": batch.initial.mirrored(),
        "controls": batch.controls.mirrored(),
    }
    known = {name: getattr(batch, name) for name in mirrored}
    return replace(batch, **jax.tree.map(choose, mirrored, known))


@eqx.filter_jit
def to_single_steps(batch: PushBatch, engine: AbstractEngine | None) -> PushBatch:
    """Return every step of every push as a push of its own, of one step.

    It starts from the true state, and the engine restarts there too (figure 2c of the
    paper); its target is the true next state, free of motion-capture noise.

    Args:
        batch: pushes whose pusher follows a path, the truth known at every step.
            (A force's pusher would count as staying at the start.)
        engine: predicts s-bar of each step; None for a network without an engine.
    """
    steps = batch.truth.shape[1]
    scene = jax.tree.map(lambda x: jnp.repeat(x, steps, axis=0), batch.scene)
    initial, controls = _states_before(batch), jax.tree.map(_each, batch.controls)
    simulated = None
    if engine is not None:
        states = engine.rollout(scene, initial, controls).states
        simulated = pack_motion(states)
    truth = _each(batch.truth)
    return PushBatch(
        scene=scene,
        initial=initial,
        controls=controls,
        truth=truth,
        measured=truth[..., :3],
        pose_observed=_each(batch.pose_observed),
        rate_observed=_each(batch.rate_observed),
        simulated=simulated,
    )


def _states_before(batch: PushBatch) -> State:
    """Return the true state before each step; the pusher is on its path."""
    initial, controls = batch.initial, batch.controls
    motion = _shifted(pack_motion(initial), batch.truth)
    path, rate = controls.pusher_motion(initial.pusher_position)
    pusher = _shifted(initial.pusher_position, path)
    velocity = _shifted(initial.pusher_velocity, rate)
    return unpack_motion(motion, pusher, velocity)


def _shifted(start: Array, after: Array) -> Array:
    """Return what was before each step, from what was after it; one row a step."""
    before = jnp.concatenate([start[:, None], after[:, :-1]], axis=1)
    return before.reshape(-1, *before.shape[2:])


def _each(x: Array) -> Array:
    """Turn ``[push, time, ...]`` into ``[push * time, 1, ...]``."""
    return x.reshape(-1, 1, *x.shape[2:])


def predict_batch(
    network: AbstractNetwork, batch: PushBatch, hold: int = 1
) -> Float[Array, "time push body 6"]:
    """Predict each push recurrently from its start, with the stored s-bar (eq. 1).

    Args:
        network: IN or SAIN.
        batch: of pushes, with s-bar for SAIN.
        hold: length of the zero-order hold of an additive network (steps).
    """
    initial, has_simulator = batch.initial, network.features.has_simulator
    frame = push_frame(batch.scene, initial)
    return network.in_frame(
        batch.scene,
        Start(initial, frame, initial if has_simulator else None),
        batch.controls,
        batch.simulated if has_simulator else None,
        unroll=_unroll(network, batch.scene.body_count, hold),
    )


def _unroll(
    network: AbstractNetwork, disks: int, hold: int
) -> Callable[..., Array] | None:
    """Return how training applies a network; None is as prediction does."""
    if network.integrator.is_additive and hold > 1:
        return partial(unroll_held, hold=hold)
    if not is_one_gpu():
        return None
    try:
        fused = import_module("sainet.models.correctors.fused.unroll")
    except ImportError:  # JAX announces the end of Triton in Pallas
        return None
    return fused.unroll_fused if fused.fits(network, disks) else None
