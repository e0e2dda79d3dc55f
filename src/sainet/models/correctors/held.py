"""Recurrent predictions of additive networks with a zero-order hold.

The output of an additive network is small and changes slowly, while a long push has a
thousand steps. It is computed every few steps and held in between; the motion that
follows from the held output is exact. The paper's networks predict the whole motion and
cannot be held: they brake and kick within a step.
"""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jaxtyping import Array, Float

from sainet.models.correctors.network import AbstractNetwork
from sainet.models.inputs import Drive, Moment, Still, in_columns
from sainet.models.integrators import Gains, RelaxingResidual, bound_gradient


def unroll_held(
    network: AbstractNetwork,
    initial: Float[Array, "push body 6"],
    still: Still,
    drive: Drive,
    *,
    before: Float[Array, "push body 6"],
    hold: int,
    is_bounded: bool = True,
) -> Float[Array, "time push body 6"]:
    """Predict like `unroll`, applying an additive network every few steps.

    Args:
        network: additive.
        initial: packed motion at the start.
        still: for each push.
        drive: with axes ``[push, time, ...]``.
        before: packed motion of the engine at the start.
        hold: steps over which f_dyn is held; 1 equals `unroll`.
        is_bounded: bound gradients as training does; False: exact gradients.
    """
    integrator = network.integrator
    assert isinstance(integrator, RelaxingResidual)
    simulated = _simulated(before, drive)
    still, gain = in_columns(still), integrator.gains(network.time_step, hold)
    held = jax.vmap(in_columns)(_time_first(_each(drive, hold)))
    engine = jax.vmap(in_columns)(_time_first(simulated[:, :-1:hold]))

    @jax.checkpoint
    def body(deviation: Array, now: tuple[Array, Drive]) -> tuple[Array, Array]:
        engine, drive = now
        deviation = bound_gradient(deviation) if is_bounded else deviation
        change = network.acceleration(Moment(engine + deviation, still, drive))
        path = _held(deviation, change, gain)
        return path[-1], path

    # [block, step, 6, body, push]
    path = lax.scan(body, in_columns(initial - before), (engine, held))[1]
    steps = simulated.shape[1] - 1
    deviation = jax.vmap(in_columns)(path.reshape(-1, *path.shape[2:])[:steps])
    return _time_first(simulated[:, 1:]) + deviation


def _held(
    deviation: Float[Array, "6 body push"],
    change: Float[Array, "3 body push"],
    gain: Gains,
) -> Float[Array, "step 6 body push"]:
    """Return the deviation after each step over which the change is held."""

    def each(numbers: np.ndarray, x: Array) -> Array:
        return jnp.asarray(numbers, x.dtype)[:, None, None, None] * x[None]

    pose, rate = deviation[:3], deviation[3:]
    pose = (
        pose[None] + each(gain.pose_of_rate, rate) + each(gain.pose_of_change, change)
    )
    rate = each(gain.rate_of_rate, rate) + each(gain.rate_of_change, change)
    return jnp.concatenate([pose, rate], axis=1)


def _simulated(
    initial: Float[Array, "push body 6"], drive: Drive
) -> Float[Array, "push state body 6"]:
    """Return s-bar, packed, from the start on."""
    step = jnp.concatenate(_steps(drive), axis=-1)
    return jnp.cumsum(jnp.concatenate([initial[:, None], step], axis=1), axis=1)


def _each(drive: Drive, hold: int) -> Drive:
    """Return the inputs of the network at each of its applications.

    The command is that of the first step; the engine's step is the mean over the hold,
    because contact kicks within a single step.
    """
    pusher = None if drive.pusher is None else drive.pusher[:, ::hold]
    means = (_mean(step, hold) for step in _steps(drive))
    return Drive(drive.action[:, ::hold], pusher, *means)


def _steps(drive: Drive) -> tuple[Array, Array]:
    """Return the steps of the simulated pose and rate."""
    pose, rate = drive.simulated_pose_step, drive.simulated_rate_step
    assert pose is not None
    assert rate is not None
    return pose, rate


def _mean(
    step: Float[Array, "push time body 3"], hold: int
) -> Float[Array, "push block body 3"]:
    """Return means over so many steps, the last one over those that are left."""
    steps, missing = step.shape[1], -step.shape[1] % hold
    step = jnp.pad(step, [(0, 0), (0, missing), (0, 0), (0, 0)])
    blocks = step.reshape(step.shape[0], -1, hold, *step.shape[2:])
    each = np.minimum(hold, steps - hold * np.arange(blocks.shape[1]))
    return jnp.sum(blocks, axis=2) / jnp.asarray(each)[None, :, None, None]


def _time_first(tree: Any) -> Any:  # noqa: ANN401
    """Swap the axes ``[push, time]`` of every array."""
    return jax.tree.map(lambda x: jnp.moveaxis(x, 1, 0), tree)
