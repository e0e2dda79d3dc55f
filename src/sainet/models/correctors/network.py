"""Networks that predict the acceleration of each body, and their recurrent use."""

from abc import abstractmethod
from collections.abc import Callable
from functools import partial
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, Float, PRNGKeyArray

from sainet.models import integrators
from sainet.models.correctors import AbstractCorrector, Prediction, Purpose, Start
from sainet.models.features import AbstractFeatures
from sainet.models.inputs import (
    Drive,
    Moment,
    Still,
    drives,
    in_columns,
    motion_from_frame,
    motion_to_frame,
)
from sainet.scenes.controls import Controls
from sainet.scenes.scene import Scene
from sainet.scenes.state import Trajectory, pack_motion, unpack_motion

FEATURE_BOUND = 4.0  # standard deviations
_CHECKPOINTED_STEPS = 2  # of the scan's body: recomputing beats reading from memory


class Layers(eqx.Module):
    """Linear layers with ReLU after all but the last."""

    weights: tuple[Float[Array, "input output"], ...]
    biases: tuple[Float[Array, " output"], ...]

    def __init__(self, widths: tuple[int, ...], *, key: PRNGKeyArray) -> None:
        """Draw weights uniformly within one over the root of the inputs."""
        keys = jax.random.split(key, (len(widths) - 1, 2))
        weights, biases = [], []
        for (inputs, outputs), (weight_key, bias_key) in zip(
            zip(widths[:-1], widths[1:], strict=True), keys, strict=True
        ):
            reach = inputs**-0.5
            draw = jax.random.uniform
            shape = (inputs, outputs)
            weights.append(draw(weight_key, shape, minval=-reach, maxval=reach))
            biases.append(draw(bias_key, (outputs,), minval=-reach, maxval=reach))
        self.weights, self.biases = tuple(weights), tuple(biases)

    def __call__(self, x: Float[Array, "input *row"]) -> Float[Array, "output *row"]:
        """Apply the layers to each column."""
        last, shape = len(self.weights) - 1, x.shape[1:]
        x = x.reshape(x.shape[0], -1)
        for index, (weight, bias) in enumerate(
            zip(self.weights, self.biases, strict=True)
        ):
            x = weight.T @ x + like(bias, x)
            x = x if index == last else jax.nn.relu(x)
        return x.reshape(-1, *shape)


def like(numbers: Float[Array, " number"], x: Array) -> Array:
    """Return one number a row of x, to be broadcast over its columns."""
    return numbers.reshape(-1, *(1,) * (x.ndim - 1))


class Scales(eqx.Module):
    """Statistics of the training data; kept with the network, never trained."""

    pair_mean: Float[Array, " pair"]
    pair_deviation: Float[Array, " pair"]
    body_mean: Float[Array, " body"]
    body_deviation: Float[Array, " body"]
    acceleration: Float[Array, " 3"]  # m/s^2, m/s^2, rad/s^2


class AbstractNetwork(AbstractCorrector):
    """Predicts the next motion of any number of bodies, by the acceleration of each."""

    scales: eqx.AbstractVar[Scales]
    features: eqx.AbstractVar[Any]  # `AbstractFeatures`; each form has its own
    time_step: eqx.AbstractVar[float]  # s
    integrator: eqx.AbstractVar[Any]  # `Integrator`

    @property
    def made_for(self) -> Purpose:
        """The pushes that the network is for."""
        return Purpose(self.features.kind, self.time_step)

    @property
    @abstractmethod
    def trained(self) -> tuple[Layers, ...]:
        """The layers that are trained: everything except the scales."""

    @property
    def unroll(self) -> Callable[..., Array]:
        """How the network is applied recurrently: see `unroll`."""
        return unroll

    @abstractmethod
    def acceleration(self, moment: Moment) -> Float[Array, "3 body push"]:
        """Return the acceleration of each body: m/s^2, m/s^2 and rad/s^2."""

    def step(
        self, motion: Float[Array, "6 body push"], still: Still, drive: Drive
    ) -> Float[Array, "6 body push"]:
        """Return the next packed motion.

        Args:
            motion: of every push, in columns (see `inputs.in_columns`).
            still: in columns.
            drive: in columns.
        """
        change = self.acceleration(Moment(motion, still, drive))
        return self.integrator.step(motion, change, drive, self.time_step)

    @eqx.filter_jit
    def correct(
        self,
        scene: Scene,
        start: Start,
        controls: Controls,
        simulated: Trajectory | None,
    ) -> Prediction:
        """Predict the states after each step of the controls."""
        path = None if simulated is None else pack_motion(simulated.states)
        exact = partial(self.unroll, is_bounded=False)
        local = self.in_frame(scene, start, controls, path, unroll=exact)
        motion = jax.vmap(motion_from_frame, in_axes=(0, None), out_axes=1)(
            local, start.frame
        )
        pusher, velocity = controls.pusher_motion(start.predicted.pusher_position)
        return Prediction(Trajectory(unpack_motion(motion, pusher, velocity)))

    def in_frame(
        self,
        scene: Scene,
        start: Start,
        controls: Controls,
        simulated: Float[Array, "push time body 6"] | None,
        *,
        unroll: Callable[..., Array] | None = None,
    ) -> Float[Array, "time push body 6"]:
        """Predict packed motion in the push frame, after each step of the controls.

        Args:
            scene: of each push.
            start: of each push.
            controls: in the table frame.
            simulated: packed s-bar after each step, in the table frame; None for IN.
            unroll: instead of the network's own: the zero-order hold of training, or
                one with exact gradients.
        """
        self.made_for.check_disks(scene.body_count)
        frame = self.features.axes(start.frame)
        initial = motion_to_frame(pack_motion(start.predicted), frame)
        before, path = initial, None
        if simulated is not None:
            path = jax.vmap(motion_to_frame, in_axes=(1, None), out_axes=1)(
                simulated, frame
            )
        if start.simulated is not None:
            before = motion_to_frame(pack_motion(start.simulated), frame)
        drive = drives(controls.in_frame(frame.origin, frame.angle), before, path)
        still = self.features.still(scene, frame)
        found = (unroll or self.unroll)(self, initial, still, drive, before=before)
        if frame is start.frame:
            return found
        return jax.vmap(
            lambda now: motion_to_frame(motion_from_frame(now, frame), start.frame)
        )(found)


def silenced(layers: Layers) -> Layers:
    """Return layers whose output is zero."""
    last = lambda those: (those.weights[-1], those.biases[-1])  # noqa: E731
    return eqx.tree_at(last, layers, replace_fn=jnp.zeros_like)


def standardise(
    x: Array, mean: Array, deviation: Array, *, is_bounded: bool = True
) -> Array:
    """Bring features to unit size and bound them smoothly.

    Contacts kick: without the bound, 200 steps of back-propagation may explode.
    """
    scaled = (x - like(mean, x)) / like(deviation, x)
    return FEATURE_BOUND * jnp.tanh(scaled / FEATURE_BOUND) if is_bounded else scaled


def unit_scales(features: AbstractFeatures) -> Scales:
    """Return scales that change nothing."""
    return Scales(
        pair_mean=jnp.zeros(features.pair_size),
        pair_deviation=jnp.ones(features.pair_size),
        body_mean=jnp.zeros(features.body_size),
        body_deviation=jnp.ones(features.body_size),
        acceleration=jnp.ones(3),
    )


def unroll(
    network: AbstractNetwork,
    initial: Float[Array, "push body 6"],
    still: Still,
    drive: Drive,
    *,
    before: Float[Array, "push body 6"] | None = None,
    is_bounded: bool = True,
) -> Float[Array, "time push body 6"]:
    """Predict recurrently from each initial motion, all in the push frame (eq. 1).

    Args:
        network: to be applied at every step.
        initial: packed motion at the start.
        still: for each push.
        drive: with axes ``[push, time, ...]``.
        before: packed motion of the engine at the start, for forms that need it.
        is_bounded: bound gradients as training does; False: exact gradients.

    Returns:
        The packed motion after each step, time first.
    """
    del before
    still = in_columns(still)

    @jax.checkpoint
    def body(motion: Array, now: Drive) -> tuple[Array, Array]:
        motion = integrators.bound_gradient(motion) if is_bounded else motion
        motion = network.step(motion, still, now)
        return motion, motion

    time_first = jax.tree.map(lambda x: jnp.moveaxis(x, 1, 0), drive)
    columns = jax.vmap(in_columns)(time_first)
    path = lax.scan(body, in_columns(initial), columns, unroll=_CHECKPOINTED_STEPS)[1]
    return jax.vmap(in_columns)(path)
