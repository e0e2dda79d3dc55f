"""What the two networks are shown, as numbers.

The paper's features (eq. 4 to 5 for the plain network, eq. 9 to 10 with the simulator's
prediction), in the push frame. A part that a network is not shown is an empty array,
so that the same code serves both.

The networks read columns: the numbers of a body run along the first axis, the pushes
along the last. Whatever is computed for each number is then one pass over memory,
which makes a training iteration some 7 % faster than the reverse does.
"""

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from sainet.models.frame import PushFrame
from sainet.scenes.controls import Controls, PathControls
from sainet.scenes.scene import Scene

ACTION_SIZE = {"robot": 5, "direct-force": 4}
FEATURES = ("paper", "place")
_PLACE_SIZE = 8  # x, y, cos and sin of three angles
_PAIR_SIZE = 12  # v_i, p_i - p_j, v_i - v_j, m_i, m_j, r_i, r_j
_BODY_SIZE = 5  # v_i, m_i, r_i


class Drive(NamedTuple):
    """What drives the networks from outside at one step of each push."""

    action: Float[Array, "push action"]  # the part that needs no predicted state
    pusher: Float[Array, "push 2"]  # m, the commanded pusher (robot), else empty
    simulated_pose_step: Float[Array, "push body 3 or 0"]  # p-bar(t+1) - p-bar(t)
    simulated_rate_step: Float[Array, "push body 3 or 0"]  # v-bar(t+1) - v-bar(t)


class Still(NamedTuple):
    """What stays the same during each push."""

    mass: Float[Array, "push body"]  # kg
    radius: Float[Array, "push body"]  # m
    pushed: Float[Array, "push body"]  # 1 for the pushed disk
    pusher_radius: Float[Array, " push"]  # m
    origin: Float[Array, "push 2"]  # m, of the push frame on the table; else empty
    heading: Float[Array, "push 2"]  # its x axis on the table; else empty


class FeatureSizes(eqx.Module):
    """How many numbers each network is shown."""

    kind: str = eqx.field(static=True)
    augmented: bool = eqx.field(static=True)
    place: bool = eqx.field(static=True, default=False)  # beyond the paper

    @property
    def pair(self) -> int:
        """Inputs of f_rel."""
        return _PAIR_SIZE + 3 * self.augmented

    @property
    def body(self) -> int:
        """Inputs of f_dyn that are not the summed effects."""
        paper = _BODY_SIZE + ACTION_SIZE[self.kind] + 3 * self.augmented
        return paper + _PLACE_SIZE * self.place


def in_columns(tree: Any) -> Any:  # noqa: ANN401
    """Reverse the axes of every array: push, body, number become number, body, push."""
    return jax.tree.map(jnp.transpose, tree)


def pair_features(
    motion: Float[Array, "6 body push"], still: Still, drive: Drive
) -> Float[Array, "feature other body push"]:
    """Return the inputs of f_rel: place k pairs each body i with body i + k + 1.

    Rolling the bodies visits every ordered pair once, for any number of them,
    without a mask and without a gather.

    Args:
        motion: packed motion, in columns.
        still: in columns.
        drive: in columns.
    """
    own = jnp.concatenate([motion[3:6], drive.simulated_rate_step])
    seen = jnp.concatenate([motion[0:2], motion[3:6]])
    props = jnp.stack([still.mass, still.radius])
    pairs = [
        jnp.concatenate(
            [
                own,
                seen - jnp.roll(seen, -shift, axis=1),
                props,
                jnp.roll(props, -shift, axis=1),
            ]
        )
        for shift in range(1, motion.shape[1])
    ]
    return jnp.stack(pairs, axis=1)


def near_pairs(
    motion: Float[Array, "6 body push"], still: Still, reach: float
) -> Float[Array, "other body push"]:
    """Return 1 for each pair of `pair_features` that is within reach, 0 for the others.

    Args:
        motion: packed motion, in columns.
        still: in columns.
        reach: m, the widest gap between two surfaces that counts as near.
    """
    gaps = []
    for shift in range(1, motion.shape[1]):
        offset = motion[0:2] - jnp.roll(motion[0:2], -shift, axis=1)
        distance = jnp.sqrt(jnp.sum(offset**2, axis=0))
        gaps.append(distance - still.radius - jnp.roll(still.radius, -shift, axis=0))
    return (jnp.stack(gaps) <= reach).astype(motion.dtype)


def body_features(
    motion: Float[Array, "6 body push"], still: Still, drive: Drive
) -> Float[Array, "feature body push"]:
    """Return the inputs of f_dyn but the effects; the action is the pushed disk's.

    Args:
        motion: packed motion, in columns.
        still: in columns.
        drive: in columns.
    """
    size, (_, bodies, pushes) = drive.action.shape[0], motion.shape
    action = jnp.broadcast_to(drive.action[:, None], (size, bodies, pushes))
    if drive.pusher.shape[0]:
        offset = drive.pusher[:, None] - motion[0:2]
        distance = jnp.sqrt(jnp.sum(offset**2, axis=0) + 1e-12)
        gap = distance - still.radius - still.pusher_radius[None]
        action = jnp.concatenate([action, offset, gap[None]])
    return jnp.concatenate(
        [
            motion[3:6],
            drive.simulated_pose_step,
            still.pushed[None] * action,
            still.mass[None],
            still.radius[None],
            *_place(motion, still),
        ]
    )


def _place(motion: Float[Array, "6 body push"], still: Still) -> list[Array]:
    """Return where on the table each body is and how it and the push are turned.

    The friction of a real table varies over it and with direction, and a real body
    does not rest on it evenly: it matters from which side of its own it is pushed,
    which is the angle between the two. Every symmetry of the push frame is given up
    for that.
    """
    if not still.origin.shape[0]:
        return []
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
    return [jnp.stack(numbers)]


def still_features(scene: Scene, frame: PushFrame, sizes: FeatureSizes) -> Still:
    """Return what stays the same: the true mass and radius, never a friction.

    Args:
        scene: of each push.
        frame: of each push.
        sizes: say whether the network is shown where on the table it is.
    """
    heading = jnp.stack([jnp.cos(frame.angle), jnp.sin(frame.angle)], axis=-1)
    shown = slice(None) if sizes.place else slice(0)
    return Still(
        scene.mass,
        scene.radius,
        frame.pushed,
        scene.pusher_radius,
        frame.origin[..., shown],
        heading[..., shown],
    )


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
