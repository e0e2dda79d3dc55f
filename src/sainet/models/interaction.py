"""The interaction network: effects between pairs, then the acceleration of each body.

One class is both IN and SAIN; they differ in whether the features hold the simulator's
prediction (eq. 4 to 7 and 8 to 12 of the paper).
"""

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, Float, PRNGKeyArray

from sainet.models.bounded import bound_gradient
from sainet.models.features import (
    Drive,
    FeatureSizes,
    Still,
    body_features,
    in_columns,
    near_pairs,
    pair_features,
)
from sainet.models.relaxation import relaxation

WIDTHS = (128, 64, 32, 16)
EFFECT = WIDTHS[-1]
FEATURE_BOUND = 4.0  # standard deviations
REACH = 0.02  # m, see `_effects`
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
            x = weight.T @ x + _like(bias, x)
            x = x if index == last else jax.nn.relu(x)
        return x.reshape(-1, *shape)


def _like(numbers: Float[Array, " number"], x: Array) -> Array:
    """Return one number a row of x, to be broadcast over its columns."""
    return numbers.reshape(-1, *(1,) * (x.ndim - 1))


class Scales(eqx.Module):
    """Statistics of the training data; kept with the network, never trained."""

    pair_mean: Float[Array, " pair"]
    pair_deviation: Float[Array, " pair"]
    body_mean: Float[Array, " body"]
    body_deviation: Float[Array, " body"]
    acceleration: Float[Array, " 3"]  # m/s^2, m/s^2, rad/s^2


class InteractionNetwork(eqx.Module):
    """Predicts the next motion of any number of bodies.

    By itself, as in the paper, or as a residual on the engine's, see `step`.
    """

    rel: Layers  # f_rel
    dyn: Layers  # f_dyn, which ends in a linear read-out of the accelerations
    scales: Scales
    sizes: FeatureSizes
    time_step: float = eqx.field(static=True)  # s
    residual: bool = eqx.field(static=True)  # beyond the paper, see `step`

    def __init__(
        self,
        sizes: FeatureSizes,
        *,
        time_step: float,
        key: PRNGKeyArray,
        scales: Scales | None = None,
        residual: bool = False,
    ) -> None:
        """Make an untrained network.

        Args:
            sizes: of its inputs.
            time_step: s, of the data it is for.
            key: draws the weights.
            scales: of its inputs and outputs; None is 1.
            residual: whether its acceleration is added to the engine's. Its last layer
                is zero then, so that the network is the engine until it learns.
        """
        rel_key, dyn_key = jax.random.split(key)
        self.rel = Layers((sizes.pair, *WIDTHS), key=rel_key)
        dyn = Layers((sizes.body + EFFECT, *WIDTHS, 3), key=dyn_key)
        self.dyn = _silenced(dyn) if residual else dyn
        self.scales = scales or unit_scales(sizes)
        self.sizes = sizes
        self.time_step = time_step
        self.residual = residual

    def acceleration(
        self, motion: Float[Array, "6 body push"], still: Still, drive: Drive
    ) -> Float[Array, "3 body push"]:
        """Return f_dyn of each body: m/s^2, m/s^2 and rad/s^2 (eq. 5 and 10)."""
        effect = self._effects(motion, still, drive)
        features = body_features(motion, still, drive)
        shown = _standardise(
            features, self.scales.body_mean, self.scales.body_deviation
        )
        out = self.dyn(jnp.concatenate([shown, effect]))
        return out * _like(self.scales.acceleration, out)

    def _effects(
        self, motion: Float[Array, "6 body push"], still: Still, drive: Drive
    ) -> Float[Array, "effect body push"]:
        """Sum the effects on each body: e_i = sum over j != i of f_rel(i, j).

        Of several others, those out of reach do not act. The paper sums over all; but
        the outer disks of a row are a disk apart, in training two part by 2 mm, and
        what f_rel says of a pair that it never saw is no effect.
        """
        _, bodies, pushes = motion.shape
        others = bodies - 1
        if not others:
            return jnp.zeros((EFFECT, bodies, pushes), motion.dtype)
        features = pair_features(motion, still, drive)
        shown = _standardise(
            features, self.scales.pair_mean, self.scales.pair_deviation
        )
        effects = self.rel(shown)
        if others > 1:
            effects = effects * near_pairs(motion, still, REACH)[None]
        return jnp.sum(effects, axis=1)

    def step(
        self, motion: Float[Array, "6 body push"], still: Still, drive: Drive
    ) -> Float[Array, "6 body push"]:
        """Return the next packed motion: v' = v + dt f_dyn, p' = p + dt v'.

        The residual form adds f_dyn to the engine's motion, and its deviation from that
        fades: v' = v-bar' + exp(-dt / tau) (v - v-bar) + dt f_dyn.

        Args:
            motion: of every push, in columns (see `features.in_columns`).
            still: in columns.
            drive: in columns.
        """
        rate, change = motion[3:6], self.acceleration(motion, still, drive)
        if self.residual:
            simulated = drive.simulated_pose_step / self.time_step  # over this step
            deviation = rate - (simulated - drive.simulated_rate_step)
            rate = simulated + relaxation(self.time_step) * deviation
        rate = rate + self.time_step * change
        pose = motion[0:3] + self.time_step * rate
        return jnp.concatenate([pose, rate])


def _silenced(layers: Layers) -> Layers:
    """Return layers whose last says zero to everything."""
    last = lambda those: (those.weights[-1], those.biases[-1])  # noqa: E731
    return eqx.tree_at(last, layers, replace_fn=jnp.zeros_like)


def _standardise(x: Array, mean: Array, deviation: Array) -> Array:
    """Bring features to unit size and bound them smoothly.

    Contacts kick: without the bound, 200 steps of back-propagation explode.
    """
    scaled = (x - _like(mean, x)) / _like(deviation, x)
    return FEATURE_BOUND * jnp.tanh(scaled / FEATURE_BOUND)


def unit_scales(sizes: FeatureSizes) -> Scales:
    """Return scales that change nothing."""
    return Scales(
        pair_mean=jnp.zeros(sizes.pair),
        pair_deviation=jnp.ones(sizes.pair),
        body_mean=jnp.zeros(sizes.body),
        body_deviation=jnp.ones(sizes.body),
        acceleration=jnp.ones(3),
    )


def unroll(
    network: InteractionNetwork,
    initial: Float[Array, "push body 6"],
    still: Still,
    drive: Drive,
) -> Float[Array, "time push body 6"]:
    """Predict recurrently from each initial motion, all in the push frame (eq. 1).

    Args:
        network: to be applied at every step.
        initial: packed motion at the start.
        still: for each push.
        drive: with axes ``[push, time, ...]``.

    Returns:
        The packed motion after each step, time first.
    """
    still = in_columns(still)

    @jax.checkpoint
    def body(motion: Array, now: Drive) -> tuple[Array, Array]:
        motion = network.step(bound_gradient(motion), still, now)
        return motion, motion

    time_first = jax.tree.map(lambda x: jnp.moveaxis(x, 1, 0), drive)
    columns = jax.vmap(in_columns)(time_first)
    path = lax.scan(body, in_columns(initial), columns, unroll=_CHECKPOINTED_STEPS)[1]
    return jax.vmap(in_columns)(path)
