"""Network inputs: sets of blocks, whose order is the layout of the first weights."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array, Float

from sainet.models.blocks import (
    ACTIONS,
    Block,
    Motion,
    Place,
    Properties,
    RelativeMotion,
    RelativePose,
    SimulatedStep,
)
from sainet.models.inputs import Moment, PushFrame, Still, still_features
from sainet.scenes.scene import Scene

Signs = tuple[int, ...]


class AbstractFeatures(ABC):
    """The inputs of a network."""

    pair_signs: ClassVar[Signs] = ()  # of mirrored inputs; none without symmetry
    body_signs: ClassVar[Signs] = ()

    @property
    @abstractmethod
    def kind(self) -> str:
        """The setup whose controls the network takes."""

    @property
    @abstractmethod
    def has_simulator(self) -> bool:
        """Whether the network takes the simulator prediction."""

    @property
    def has_place(self) -> bool:
        """Whether the network takes the place on the table."""
        return False

    @property
    def are_standardised(self) -> bool:
        """Whether the inputs and outputs are scaled by the training data."""
        return True

    @property
    def are_bounded(self) -> bool:
        """Whether the scaled inputs are bounded smoothly."""
        return True

    def axes(self, frame: PushFrame) -> PushFrame:
        """Return the frame of the inputs and outputs of a push: the push frame."""
        return frame

    @property
    @abstractmethod
    def pair_size(self) -> int:
        """Inputs of f_rel."""

    @property
    @abstractmethod
    def body_size(self) -> int:
        """Inputs of f_dyn that are not the summed effects."""

    @abstractmethod
    def of_pairs(self, moment: Moment) -> Float[Array, "feature other body push"]:
        """Return the inputs of f_rel: entry k pairs each body i with body i + k + 1."""

    @abstractmethod
    def of_bodies(self, moment: Moment) -> Float[Array, "feature body push"]:
        """Return the inputs of f_dyn except the effects."""

    def still(self, scene: Scene, frame: PushFrame) -> Still:
        """Return the properties that the network is given: the true ones."""
        return still_features(scene, frame)

    def pair_weights(self, moment: Moment) -> Float[Array, "other body push"] | None:
        """Return how much each pair counts in statistics; None is equally."""
        del moment

    def body_weights(self, moment: Moment) -> Float[Array, "body push"] | None:
        """Return how much each body counts in statistics; None is equally."""
        del moment


@dataclass(frozen=True)
class FeatureSet(AbstractFeatures):
    """The inputs of a network: blocks in the order of its weights."""

    blocks: tuple[Block, ...]
    has_si_units: bool = False  # or inputs that the training data scale
    has_table_axes: bool = False  # or those of the push frame
    has_bounds: bool = True  # of scaled inputs

    def axes(self, frame: PushFrame) -> PushFrame:
        """Return the frame of the inputs and outputs of a push."""
        return frame.along_table() if self.has_table_axes else frame

    @property
    def are_standardised(self) -> bool:
        """Whether the inputs and outputs are scaled by the training data."""
        return not self.has_si_units

    @property
    def are_bounded(self) -> bool:
        """Whether the scaled inputs are bounded smoothly."""
        return self.are_standardised and self.has_bounds

    @property
    def pair_size(self) -> int:
        """Inputs of f_rel."""
        return sum(block.pair_size for block in self.blocks)

    @property
    def body_size(self) -> int:
        """Inputs of f_dyn that are not the summed effects."""
        return sum(block.body_size for block in self.blocks)

    @property
    def kind(self) -> str:
        """The setup whose controls the network takes: a key of `ACTIONS`."""
        return next(name for name, block in ACTIONS.items() if block in self.blocks)

    @property
    def has_simulator(self) -> bool:
        """Whether the network takes the simulator prediction."""
        return SimulatedStep() in self.blocks

    @property
    def has_place(self) -> bool:
        """Whether the network takes the place on the table."""
        return Place() in self.blocks

    def of_pairs(self, moment: Moment) -> Float[Array, "feature other body push"]:
        """Return the inputs of f_rel: entry k pairs each body i with body i + k + 1.

        Rolling the bodies visits every ordered pair once, for any number of them,
        without a mask and without a gather.
        """
        bodies, _ = moment.shape
        pairs = [
            _joined(self.blocks, lambda block, by=by: block.of_pairs(moment, by))
            for by in range(1, bodies)
        ]
        return jnp.stack(pairs, axis=1)

    def of_bodies(self, moment: Moment) -> Float[Array, "feature body push"]:
        """Return the inputs of f_dyn except the effects."""
        return _joined(self.blocks, lambda block: block.of_bodies(moment))


def _joined(
    blocks: Sequence[Block], columns: Callable[[Block], Sequence[Array]]
) -> Array:
    return jnp.concatenate([part for block in blocks for part in columns(block)])


# By the letter of the paper: SI units as they are, relative poses with their angles.
LETTER, LETTER_IN_PUSH_FRAME = "letter", "letter-push-frame"
# On the way from there to the usual features: our relative motion, then our scales.
LETTER_MOTION, UNBOUNDED = "letter-motion", "unbounded"


def feature_set(kind: str, *, simulator: bool, name: str = "paper") -> FeatureSet:
    """Return the features of an interaction network.

    Args:
        kind: setup whose controls the network takes, `robot` or `direct-force`.
        simulator: include the simulator prediction (SAIN).
        name: of the features: `paper`, `place`, or those by the letter and on the way.
    """
    optional = (SimulatedStep(),) if simulator else ()
    has_poses = name in (LETTER, LETTER_IN_PUSH_FRAME)
    has_si_units = has_poses or name == LETTER_MOTION
    relative = RelativePose() if has_poses else RelativeMotion()
    blocks = (Motion(), *optional, relative, ACTIONS[kind], Properties())
    return FeatureSet(
        (*blocks, Place()) if name == "place" else blocks,
        has_si_units=has_si_units,
        has_table_axes=name == LETTER,
        has_bounds=name != UNBOUNDED,
    )
