"""The feedforward network: the whole state of a scene in, all accelerations out.

The form of Ajay et al. (2018), from which the paper departs with its object-based
networks: one network takes the state of all disks at once. It has neither objects nor
relations, so that it takes only as many disks as it was made for, each in its place:
disk 1 is pushed.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float, PRNGKeyArray

from sainet.models.blocks import ACTIONS, Block, Motion, Properties, SimulatedStep
from sainet.models.correctors import Purpose
from sainet.models.correctors.interaction import WIDTHS
from sainet.models.correctors.network import (
    AbstractNetwork,
    Layers,
    Scales,
    like,
    silenced,
    standardise,
    unit_scales,
)
from sainet.models.features import AbstractFeatures, FeatureSet
from sainet.models.inputs import Moment, given
from sainet.models.integrators import Acceleration, Integrator


class Position(Block):
    """Place in the push frame; disks look alike at every angle."""

    body_size = 2

    def of_bodies(self, moment: Moment) -> Sequence[Array]:
        """Return x and y (m)."""
        return (moment.motion[0:2],)


class SimulatedRateStep(Block):
    """One step of the simulated velocity and spin."""

    body_size = 3

    def of_bodies(self, moment: Moment) -> Sequence[Array]:
        """Return the step of the simulated velocity and spin."""
        return (given(moment.drive.simulated_rate_step),)


@dataclass(frozen=True)
class WholeState(AbstractFeatures):
    """The inputs of a feedforward network: those of every disk, one after another."""

    each: FeatureSet  # of one disk
    disks: int  # in every scene

    @property
    def kind(self) -> str:
        """The setup whose controls the network takes."""
        return self.each.kind

    @property
    def has_simulator(self) -> bool:
        """Whether the network takes the simulator prediction."""
        return self.each.has_simulator

    @property
    def pair_size(self) -> int:
        """None: there are no pairs."""
        return 0

    @property
    def body_size(self) -> int:
        """Inputs of the whole."""
        return self.disks * self.each.body_size

    def of_pairs(self, moment: Moment) -> Float[Array, "0 other body push"]:
        """Return no numbers of each pair."""
        bodies, pushes = moment.shape
        return jnp.zeros((0, bodies - 1, bodies, pushes), moment.motion.dtype)

    def of_bodies(self, moment: Moment) -> Float[Array, "feature 1 push"]:
        """Return the inputs of the whole, as if it were one body."""
        numbers = self.each.of_bodies(moment)
        return numbers.reshape(self.body_size, 1, moment.shape[1])


def whole_state(kind: str, *, simulator: bool, disks: int) -> WholeState:
    """Return the inputs of a feedforward network.

    Args:
        kind: setup whose controls the network takes, `robot` or `direct-force`.
        simulator: include the simulator prediction.
        disks: number of disks of every scene.
    """
    optional = (SimulatedStep(), SimulatedRateStep()) if simulator else ()
    blocks = (Position(), Motion(), *optional, ACTIONS[kind], Properties())
    return WholeState(FeatureSet(blocks), disks)


class FeedforwardNetwork(AbstractNetwork):
    """Predicts the next motion of a fixed number of bodies from their whole state."""

    layers: Layers  # from the whole state to the accelerations of all bodies
    scales: Scales
    features: WholeState = eqx.field(static=True)
    time_step: float = eqx.field(static=True)  # s
    integrator: Integrator = eqx.field(static=True)

    def __init__(
        self,
        features: WholeState,
        *,
        time_step: float,
        key: PRNGKeyArray,
        scales: Scales | None = None,
        integrator: Integrator = Acceleration(),  # noqa: B008
    ) -> None:
        """Make an untrained network.

        Args:
            features: its inputs.
            time_step: s, of the pushes that it is for.
            key: draws the weights.
            scales: of its inputs and outputs; None is 1.
            integrator: of its accelerations. The last layer of an additive network is
                zero.
        """
        widths = (features.body_size, *WIDTHS, 3 * features.disks)
        layers = Layers(widths, key=key)
        self.layers = silenced(layers) if integrator.is_additive else layers
        self.scales = scales or unit_scales(features)
        self.features = features
        self.time_step = time_step
        self.integrator = integrator

    @property
    def made_for(self) -> Purpose:
        """The pushes that the network is for, of a fixed number of disks."""
        return Purpose(self.features.kind, self.time_step, self.features.disks)

    @property
    def trained(self) -> tuple[Layers, ...]:
        """All of its layers."""
        return (self.layers,)

    def acceleration(self, moment: Moment) -> Float[Array, "3 body push"]:
        """Return the acceleration of each body: m/s^2, m/s^2 and rad/s^2."""
        inputs = standardise(
            self.features.of_bodies(moment),
            self.scales.body_mean,
            self.scales.body_deviation,
        )
        out = self.layers(inputs).reshape(3, *moment.shape)
        return out * like(self.scales.acceleration, out)
