"""Network inputs: blocks of features in the push frame.

The paper's features (eq. 4 to 5 without an engine, eq. 9 to 10 with the simulator
prediction) and what goes beyond them. The order of the blocks is the layout of the
first layer's weights.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array, Float

from sainet.models.inputs import Moment, PushFrame, Still, given, still_features
from sainet.scenes.scene import Scene


@dataclass(frozen=True)
class Block:
    """Features that belong together; a network has them or lacks them as a whole.

    Blocks have no fields: those of one class are equal.
    """

    pair_size: ClassVar[int] = 0  # inputs of f_rel
    body_size: ClassVar[int] = 0  # inputs of f_dyn

    def of_pairs(
        self, moment: Moment, shift: int
    ) -> Sequence[Float[Array, "number body push"]]:
        """Return inputs of f_rel for each body and the one `shift` places behind it."""
        del moment, shift
        return ()

    def of_bodies(self, moment: Moment) -> Sequence[Float[Array, "number body push"]]:
        """Return inputs of f_dyn for each body."""
        del moment
        return ()


class Motion(Block):
    """Velocity and spin of a body."""

    pair_size = 3
    body_size = 3

    def of_pairs(self, moment: Moment, shift: int) -> Sequence[Array]:
        """Return v_i."""
        del shift
        return self.of_bodies(moment)

    def of_bodies(self, moment: Moment) -> Sequence[Array]:
        """Return v_i."""
        return (moment.motion[3:6],)


class SimulatedStep(Block):
    """One step of the simulator prediction (eq. 9 and 10)."""

    pair_size = 3
    body_size = 3

    def of_pairs(self, moment: Moment, shift: int) -> Sequence[Array]:
        """Return the step of the simulated velocity and spin."""
        del shift
        return (given(moment.drive.simulated_rate_step),)

    def of_bodies(self, moment: Moment) -> Sequence[Array]:
        """Return the step of the simulated pose."""
        return (given(moment.drive.simulated_pose_step),)


class RelativeMotion(Block):
    """Offset and relative motion of two bodies."""

    pair_size = 5

    def of_pairs(self, moment: Moment, shift: int) -> Sequence[Array]:
        """Return p_i - p_j (m) and v_i - v_j."""
        motion = jnp.concatenate([moment.motion[0:2], moment.motion[3:6]])
        return (motion - jnp.roll(motion, -shift, axis=1),)


class PathAction(Block):
    """Commanded pusher relative to the pushed disk; zeros for the other disks."""

    body_size = 5

    def of_bodies(self, moment: Moment) -> Sequence[Array]:
        """Return commanded velocity, offset of the pusher (m) and gap (m)."""
        still, pusher = moment.still, given(moment.drive.pusher)
        offset = pusher[:, None] - moment.motion[0:2]
        distance = jnp.sqrt(jnp.sum(offset**2, axis=0) + 1e-12)
        gap = distance - still.radius - still.pusher_radius[None]
        action = jnp.concatenate([_for_all(moment), offset, gap[None]])
        return (still.pushed[None] * action,)


class ForceAction(Block):
    """Force on the pusher and initial contact offset; zeros for the other disks."""

    body_size = 4

    def of_bodies(self, moment: Moment) -> Sequence[Array]:
        """Return force (N) and contact offset (m)."""
        return (moment.still.pushed[None] * _for_all(moment),)


class Properties(Block):
    """Mass and radius, never a friction."""

    pair_size = 4
    body_size = 2

    def of_pairs(self, moment: Moment, shift: int) -> Sequence[Array]:
        """Return m_i, r_i, m_j and r_j."""
        own = jnp.stack([moment.still.mass, moment.still.radius])
        return own, jnp.roll(own, -shift, axis=1)

    def of_bodies(self, moment: Moment) -> Sequence[Array]:
        """Return m_i and r_i."""
        return moment.still.mass[None], moment.still.radius[None]


class Place(Block):
    """Place on the table, angle there, and push direction: beyond the paper.

    The friction of a real table varies over it and with direction, and a real body
    does not rest on it evenly: the side of the body that is pushed matters too, which
    is the angle between the two. It gives up every symmetry of the push frame.
    """

    body_size = 8

    def of_bodies(self, moment: Moment) -> Sequence[Array]:
        """Return x, y (m), and cosine and sine of three angles."""
        motion, still = moment.motion, moment.still
        cosine, sine = still.heading[:, None]  # [1, push]
        x, y, turn = motion[0], motion[1], motion[2]
        own_cosine, own_sine = jnp.cos(turn), jnp.sin(turn)
        numbers = [
            still.origin[0][None] + cosine * x - sine * y,
            still.origin[1][None] + sine * x + cosine * y,
            cosine * own_cosine - sine * own_sine,
            sine * own_cosine + cosine * own_sine,
            jnp.broadcast_to(cosine, x.shape),
            jnp.broadcast_to(sine, x.shape),
            own_cosine,  # its angle in the push frame
            own_sine,
        ]
        return (jnp.stack(numbers),)


def _for_all(moment: Moment) -> Array:
    """Return the action of each push, repeated for every body."""
    action = moment.drive.action
    return jnp.broadcast_to(action[:, None], (action.shape[0], *moment.shape))


# The action's features, by the setup that makes the controls.
ACTIONS: dict[str, Block] = {"robot": PathAction(), "direct-force": ForceAction()}


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
    @abstractmethod
    def has_place(self) -> bool:
        """Whether the network takes the place on the table."""

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


def feature_set(kind: str, *, simulator: bool, place: bool = False) -> FeatureSet:
    """Return the features of a network.

    Args:
        kind: setup whose controls the network takes, `robot` or `direct-force`.
        simulator: include the simulator prediction (SAIN).
        place: include the place on the table.
    """
    optional = (SimulatedStep(),) if simulator else ()
    paper = (Motion(), *optional, RelativeMotion(), ACTIONS[kind], Properties())
    return FeatureSet((*paper, Place()) if place else paper)
