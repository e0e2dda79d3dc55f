"""What the two networks are shown, as numbers.

The paper's features (eq. 4 to 5 for the plain network, eq. 9 to 10 with the simulator's
prediction), in the push frame. A part that a network is not shown is an empty array,
so that the same code serves both.
"""

from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from sainet.pushes import Controls, PathControls
from sainet.scene import Scene

ACTION_SIZE = {"robot": 5, "direct-force": 4}
_PAIR_SIZE = 12  # v_i, p_i - p_j, v_i - v_j, m_i, m_j, r_i, r_j
_BODY_SIZE = 5  # v_i, m_i, r_i


class Drive(NamedTuple):
    """What drives the networks from outside at one step, for one scene."""

    action: Float[Array, " action"]  # the part that needs no predicted state
    pusher: Float[Array, " 2"]  # m, the commanded pusher (robot), else empty
    simulated_pose_step: Float[Array, "body 3 or 0"]  # p-bar(t+1) - p-bar(t)
    simulated_rate_step: Float[Array, "body 3 or 0"]  # v-bar(t+1) - v-bar(t)


class Still(NamedTuple):
    """What stays the same during a push, for one scene."""

    mass: Float[Array, " body"]  # kg
    radius: Float[Array, " body"]  # m
    pushed: Float[Array, " body"]  # 1 for the pushed disk
    pusher_radius: Float[Array, ""]  # m


class FeatureSizes(eqx.Module):
    """How many numbers each network is shown."""

    kind: str = eqx.field(static=True)
    augmented: bool = eqx.field(static=True)

    @property
    def pair(self) -> int:
        """Inputs of f_rel."""
        return _PAIR_SIZE + 3 * self.augmented

    @property
    def body(self) -> int:
        """Inputs of f_dyn that are not the summed effects."""
        return _BODY_SIZE + ACTION_SIZE[self.kind] + 3 * self.augmented


def pair_features(
    motion: Float[Array, "body 6"], still: Still, drive: Drive
) -> Float[Array, "other body feature"]:
    """Return the inputs of f_rel: row k pairs each body i with body i + k + 1.

    Rolling the bodies visits every ordered pair once, for any number of them,
    without a mask and without a gather.
    """
    count = motion.shape[0]
    own = jnp.concatenate([motion[:, 3:6], drive.simulated_rate_step], axis=-1)
    seen = jnp.concatenate([motion[:, 0:2], motion[:, 3:6]], axis=-1)
    props = jnp.stack([still.mass, still.radius], axis=-1)
    rows = [
        jnp.concatenate(
            [
                own,
                seen - jnp.roll(seen, -shift, axis=0),
                props,
                jnp.roll(props, -shift, axis=0),
            ],
            axis=-1,
        )
        for shift in range(1, count)
    ]
    return jnp.stack(rows)


def body_features(
    motion: Float[Array, "body 6"], still: Still, drive: Drive
) -> Float[Array, "body feature"]:
    """Return the inputs of f_dyn but the effects; the action is the pushed disk's."""
    action = jnp.broadcast_to(
        drive.action[None], (motion.shape[0], drive.action.shape[0])
    )
    if drive.pusher.shape[-1]:
        offset = drive.pusher[None] - motion[:, 0:2]
        distance = jnp.sqrt(jnp.sum(offset**2, axis=-1) + 1e-12)
        gap = distance - still.radius - still.pusher_radius
        action = jnp.concatenate([action, offset, gap[:, None]], axis=-1)
    return jnp.concatenate(
        [
            motion[:, 3:6],
            drive.simulated_pose_step,
            still.pushed[:, None] * action,
            still.mass[:, None],
            still.radius[:, None],
        ],
        axis=-1,
    )


def still_features(scene: Scene, pushed: Float[Array, "*batch body"]) -> Still:
    """Return what stays the same: the true mass and radius, never a friction."""
    return Still(scene.mass, scene.radius, pushed, scene.pusher_radius)


def drives(
    controls: Controls,
    initial: Float[Array, "*batch body 6"],
    simulated: Float[Array, "*batch time body 6"] | None,
) -> Drive:
    """Return what drives the networks at every step; all in the push frame.

    Args:
        controls: of the push.
        initial: packed motion that both predictions start from.
        simulated: packed s-bar after each step; None for the plain network.
    """
    action, pusher = _action(controls)
    if simulated is None:
        shape = (*action.shape[:-1], initial.shape[-2], 0)
        return Drive(action, pusher, jnp.zeros(shape), jnp.zeros(shape))
    whole = jnp.concatenate([initial[..., None, :, :], simulated], axis=-3)
    step = whole[..., 1:, :, :] - whole[..., :-1, :, :]
    return Drive(action, pusher, step[..., 0:3], step[..., 3:6])


def _action(controls: Controls) -> tuple[Array, Array]:
    if isinstance(controls, PathControls):
        return controls.velocity, controls.position
    offset = jnp.broadcast_to(
        controls.contact_offset[..., None, :], controls.force.shape
    )
    action = jnp.concatenate([controls.force, offset], axis=-1)
    return action, jnp.zeros((*action.shape[:-1], 0))
