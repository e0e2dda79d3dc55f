"""The interaction network: effects between pairs, then the acceleration of each body.

One class is both IN and SAIN; SAIN's features include the simulator prediction (eq. 4
to 7 and 8 to 12 of the paper).
"""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PRNGKeyArray

from sainet.models import integrators
from sainet.models.correctors.network import (
    AbstractNetwork,
    Layers,
    Scales,
    like,
    silenced,
    standardise,
    unit_scales,
)
from sainet.models.features import FeatureSet
from sainet.models.inputs import Moment, near_pairs

WIDTHS = (128, 64, 32, 16)
EFFECT = WIDTHS[-1]
REACH = 0.02  # m, see `_effects`


class InteractionNetwork(AbstractNetwork):
    """Predicts the next motion of any number of bodies.

    Attributes:
        rel: f_rel, of the inputs of pairs of bodies.
        dyn: f_dyn, which ends in a linear read-out of the accelerations.
        scales: of inputs and accelerations.
        features: the inputs.
        time_step: of the pushes that it is for (s).
        integrator: of the accelerations.
    """

    rel: Layers
    dyn: Layers
    scales: Scales
    features: FeatureSet = eqx.field(static=True)
    time_step: float = eqx.field(static=True)
    integrator: integrators.Integrator = eqx.field(static=True)

    def __init__(
        self,
        features: FeatureSet,
        *,
        time_step: float,
        key: PRNGKeyArray,
        scales: Scales | None = None,
        integrator: integrators.Integrator = integrators.Acceleration(),  # noqa: B008
    ) -> None:
        """Make an untrained network.

        Args:
            features: its inputs.
            time_step: s, of the pushes that it is for.
            key: draws the weights.
            scales: of its inputs and outputs; None is 1.
            integrator: of its accelerations. The last layer of an additive network is
                zero, so that the network predicts as its engine until it is trained.
        """
        rel_key, dyn_key = jax.random.split(key)
        self.rel = Layers((features.pair_size, *WIDTHS), key=rel_key)
        dyn = Layers((features.body_size + EFFECT, *WIDTHS, 3), key=dyn_key)
        self.dyn = silenced(dyn) if integrator.is_additive else dyn
        self.scales = scales or unit_scales(features)
        self.features = features
        self.time_step = time_step
        self.integrator = integrator

    @property
    def trained(self) -> tuple[Layers, ...]:
        """f_rel and f_dyn."""
        return self.rel, self.dyn

    def acceleration(self, moment: Moment) -> Float[Array, "3 body push"]:
        """Return f_dyn of each body: m/s^2, m/s^2 and rad/s^2 (eq. 5 and 10)."""
        inputs = self._scaled(
            self.features.of_bodies(moment),
            self.scales.body_mean,
            self.scales.body_deviation,
        )
        out = self.dyn(jnp.concatenate([inputs, self._effects(moment)]))
        return out * like(self.scales.acceleration, out)

    def _scaled(self, inputs: Array, mean: Array, deviation: Array) -> Array:
        if not self.features.are_standardised:
            return inputs
        is_bounded = self.features.are_bounded
        return standardise(inputs, mean, deviation, is_bounded=is_bounded)

    def _effects(self, moment: Moment) -> Float[Array, "effect body push"]:
        """Sum the effects on each body: e_i = sum over j != i of f_rel(i, j).

        Of several others, those out of reach do not act. The paper sums over all; but
        the outer disks of a row are a disk apart, in training two part by 2 mm, and
        the output of f_rel for pairs unlike those in training is no effect.
        """
        bodies, pushes = moment.shape
        others = bodies - 1
        if not others:
            return jnp.zeros((EFFECT, bodies, pushes), moment.motion.dtype)
        inputs = self._scaled(
            self.features.of_pairs(moment),
            self.scales.pair_mean,
            self.scales.pair_deviation,
        )
        effects = self.rel(inputs)
        if others > 1:
            effects = effects * near_pairs(moment.motion, moment.still, REACH)[None]
        return jnp.sum(effects, axis=1)
