"""Features of contacts: each in its own frame, with the strength of its effect.

What happens at a contact does not depend on where it is, which way it faces, or how
many others there are. Features in the frame of the contact therefore hold for any
number of bodies in any arrangement.
"""

from dataclasses import dataclass
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from sainet.models.features import AbstractFeatures
from sainet.models.inputs import Moment, given

REACH = 2e-3  # m, gap between two surfaces from which on nothing acts
SHARE = 0.3  # of the motion that is towards the other, from which on all of it acts
CREEP = 1e-3  # m/s, motion far below this counts as rest

_VECTOR = (1, -1)  # signs of a mirrored vector, along normal and tangent
_RATE = (*_VECTOR, -1)  # and of a spin


class Contacts(NamedTuple):
    """Possible contacts of bodies with others, in columns.

    The axes of a contact are body and push, or other, body and push.
    """

    normal: Float[Array, "2 *contact"]  # in the push frame, from the body to the other
    inputs: Float[Array, "input *contact"]
    acts: Float[Array, "*contact"]  # strength of the effect, from 0 to 1


@dataclass(frozen=True)
class ContactFeatures(AbstractFeatures):
    """The inputs of a contact network: disk and pusher, and disk and disk.

    Both have the gap (m), the rates of the body and of the other in the frame of the
    contact, now and in the simulator prediction, and masses and radii.
    """

    time_step: float  # s, of the simulator prediction

    pair_signs = (1, *_RATE, *_RATE, *_RATE, *_RATE, 1, 1, 1, 1)
    body_signs = (1, *_VECTOR, *_RATE, *_RATE, 1, 1, 1)

    @property
    def kind(self) -> str:
        """The setup in which the pusher follows a path."""
        return "robot"

    @property
    def has_simulator(self) -> bool:
        """True: it is what the network adds to."""
        return True

    @property
    def pair_size(self) -> int:
        """Inputs of a contact of two disks."""
        return len(self.pair_signs)

    @property
    def body_size(self) -> int:
        """Inputs of a contact with the pusher."""
        return len(self.body_signs)

    def of_pairs(self, moment: Moment) -> Float[Array, "feature other body push"]:
        """Return the inputs: entry k pairs each body i with body i + k + 1."""
        return self.between_disks(moment).inputs

    def of_bodies(self, moment: Moment) -> Float[Array, "feature body push"]:
        """Return the inputs of each body and the pusher."""
        return self.with_pusher(moment).inputs

    def pair_weights(self, moment: Moment) -> Float[Array, "other body push"]:
        """Return the strength of the effects."""
        return self.between_disks(moment).acts

    def body_weights(self, moment: Moment) -> Float[Array, "body push"]:
        """Return the strength of the pusher's effects."""
        return self.with_pusher(moment).acts

    def with_pusher(self, moment: Moment) -> Contacts:
        """Return the contacts of each body with the pusher."""
        still, motion = moment.still, moment.motion
        pusher = given(moment.drive.pusher)[:, None]
        normal, distance = _toward(pusher - motion[0:2])
        gap = distance - still.radius - still.pusher_radius[None]
        velocity = jnp.broadcast_to(moment.drive.action[:, None], normal.shape)
        rates = (motion[3:6], self._simulated(moment))
        radius = jnp.broadcast_to(still.pusher_radius[None], gap.shape)
        inputs = [
            gap[None],
            _turned(velocity, normal, -1),
            *(_in_contact(rate, normal) for rate in rates),
            jnp.stack([still.mass, still.radius, radius]),
        ]
        acts = _near(gap) * _closing(normal, rates[0], velocity)
        return Contacts(normal, jnp.concatenate(inputs), acts)

    def between_disks(self, moment: Moment) -> Contacts:
        """Return the contacts of each body with each other one; at least two bodies."""
        still, motion = moment.still, moment.motion
        normal, distance = _toward(_others(motion[0:2]) - motion[0:2, None])
        own = jnp.stack([still.mass, still.radius])
        other = _others(own)
        gap = distance - own[1][None] - other[1]
        rates = [
            (jnp.broadcast_to(rate[:, None], (3, *gap.shape)), _others(rate))
            for rate in (motion[3:6], self._simulated(moment))
        ]
        inputs = [
            gap[None],
            *(_in_contact(rate, normal) for both in rates for rate in both),
            jnp.broadcast_to(own[:, None], other.shape),
            other,
        ]
        # The network may have closed a gap that is open in the simulator, or opened it.
        now, simulated = (_closing(normal, *both) for both in rates)
        acts = _near(gap) * jnp.maximum(now, simulated)
        return Contacts(normal, jnp.concatenate(inputs), acts)

    def _simulated(self, moment: Moment) -> Float[Array, "3 body push"]:
        """Return the rates of the simulator prediction over the step."""
        return given(moment.drive.simulated_pose_step) / self.time_step


def _others(x: Float[Array, "number body push"]) -> Array:
    """Return the numbers of all other bodies, ``[number other body push]``."""
    shifts = range(1, x.shape[1])
    return jnp.stack([jnp.roll(x, -shift, axis=1) for shift in shifts], axis=1)


def _length(vector: Float[Array, "2 *contact"]) -> Float[Array, "*contact"]:
    return jnp.sqrt(jnp.sum(vector**2, axis=0) + 1e-12)


def _toward(offset: Float[Array, "2 *contact"]) -> tuple[Array, Array]:
    """Return unit vectors and lengths (m)."""
    distance = _length(offset)
    return offset / distance[None], distance


def _turned(vector: Array, normal: Array, way: int) -> Array:
    """Turn vectors by the angle of a normal (1), or into the contact's frame (-1)."""
    cosine, sine = normal[0], way * normal[1]
    x, y = vector[0], vector[1]
    return jnp.stack([cosine * x - sine * y, sine * x + cosine * y])


def _in_contact(rate: Array, normal: Array) -> Array:
    return jnp.concatenate([_turned(rate[0:2], normal, -1), rate[2:3]])


def from_contact(rate: Array, normal: Array) -> Float[Array, "3 *contact"]:
    """Return rates of the contact's frame in the push frame."""
    return jnp.concatenate([_turned(rate[0:2], normal, 1), rate[2:3]])


def _smooth(share: Array) -> Array:
    """Return 0 below 0, 1 above 1, and a smooth rise between."""
    share = jnp.clip(share, 0.0, 1.0)
    return share * share * (3 - 2 * share)


def _near(gap: Float[Array, "*contact"]) -> Float[Array, "*contact"]:
    """Return 1 for touching surfaces, 0 from `REACH` on."""
    return _smooth(1 - gap / REACH)


def _closing(normal: Array, own: Array, other: Array) -> Float[Array, "*contact"]:
    """Return 1 if one body moves towards the other, 0 if neither does.

    A disk beside a moving one stays at rest although they touch.
    """
    own, other = own[0:2], other[0:2]
    towards = jax.nn.relu(jnp.sum(own * normal, axis=0))
    towards += jax.nn.relu(-jnp.sum(other * normal, axis=0))
    return _smooth(towards / (_length(own) + _length(other) + CREEP) / SHARE)
