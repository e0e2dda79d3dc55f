"""Blocks of features: what networks see of a body, and of a pair of bodies.

The paper's features (eq. 4 to 5 without an engine, eq. 9 to 10 with the simulator
prediction) and what goes beyond them.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array, Float

from sainet.models.inputs import Moment, given


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


class RelativePose(Block):
    """Offset, angle and relative motion of two bodies: p_i - p_j of poses, as in eq. 4.

    The angle between two disks has no physical meaning; the equation has it.
    """

    pair_size = 6

    def of_pairs(self, moment: Moment, shift: int) -> Sequence[Array]:
        """Return p_i - p_j (m, rad) and v_i - v_j."""
        return (moment.motion - jnp.roll(moment.motion, -shift, axis=1),)


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
