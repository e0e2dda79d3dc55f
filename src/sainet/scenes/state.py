"""States of disks and pusher, and trajectories of states.

Units are metres, radians, kilograms and seconds, in the table frame.
"""

from collections.abc import Sequence
from typing import Any, cast

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jax.typing import ArrayLike
from jaxtyping import Array, Float

from sainet.runs.errors import BadScene, shown

Numbers = ArrayLike | Sequence[Any]  # an array, or lists of numbers


class State(eqx.Module):
    """Poses and velocities of the disks and the pusher, in the table frame.

    Batches of states have leading axes, push and time for example, in every field.

    Attributes:
        position: of the disks, [body, 2] (m).
        angle: of the disks, [body] (rad), counter-clockwise, never wrapped.
        velocity: of the disks, [body, 2] (m/s).
        spin: of the disks, [body] (rad/s).
        pusher_position: [2] (m).
        pusher_velocity: [2] (m/s).
    """

    position: Float[Array, "*batch body 2"]
    angle: Float[Array, "*batch body"]
    velocity: Float[Array, "*batch body 2"]
    spin: Float[Array, "*batch body"]
    pusher_position: Float[Array, "*batch 2"]
    pusher_velocity: Float[Array, "*batch 2"]

    @property
    def body_count(self) -> int:
        """The number of disks."""
        return self.angle.shape[-1]

    @property
    def pose(self) -> Float[Array, "*batch body 3"]:
        """Position and angle in one array (m, m, rad)."""
        return jnp.concatenate([self.position, self.angle[..., None]], axis=-1)

    def with_pusher_moved(self, offset: Float[Array, "*#batch 2"]) -> "State":
        """Return states with the pusher displaced by an offset (m)."""
        offset = jnp.broadcast_to(offset, self.pusher_position.shape)
        moved = self.pusher_position + offset
        return eqx.tree_at(lambda s: s.pusher_position, self, moved)

    def mirrored(self) -> "State":
        """Return states mirrored at the table's x axis."""

        def flip(vector: Array) -> Array:
            return vector.at[..., 1].multiply(-1)

        return State(
            position=flip(self.position),
            angle=-self.angle,
            velocity=flip(self.velocity),
            spin=-self.spin,
            pusher_position=flip(self.pusher_position),
            pusher_velocity=flip(self.pusher_velocity),
        )


class Trajectory(eqx.Module):
    """States after each step, without the initial state.

    In every engine and model ``p(t+1) = p(t) + dt * v(t+1)``, also during recovery of
    overlaps.

    Attributes:
        states: after each step; every field has an axis, time, directly after those of
            the batch: positions are [time, body, 2] (m), angles [time, body] (rad), of
            a batch [push, time, body, 2] and [push, time, body].
    """

    states: State

    @property
    def final(self) -> State:
        """The state after the last step."""
        batch = (slice(None),) * (self.states.angle.ndim - 2)
        return jax.tree.map(lambda x: x[(*batch, -1)], self.states)


def at_rest(position: Numbers, angle: Numbers, pusher_position: Numbers) -> State:
    """Return the state at rest with the given poses.

    Args:
        position: of the disks, [body, 2] (m); lists or arrays, also with leading axes.
        angle: of the disks, [body] (rad).
        pusher_position: [2] (m).
    """
    position = floats(position, "state: position")
    angle = floats(angle, "state: angle")
    pusher_position = floats(pusher_position, "state: pusher_position")
    return State(
        position=position,
        angle=angle,
        velocity=jnp.zeros_like(position),
        spin=jnp.zeros_like(angle),
        pusher_position=pusher_position,
        pusher_velocity=jnp.zeros_like(pusher_position),
    )


def floats(
    numbers: Numbers, where: str, dtype: type[np.floating] | np.dtype | None = None
) -> Array:
    """Return numbers as an array, which may be traced.

    Args:
        numbers: arrays of floating-point numbers stay as they are without `dtype`.
        where: the argument, as messages name it.
        dtype: of the array; None: single precision.

    Raises:
        BadScene: they are not numbers.
    """
    kind = np.dtype(getattr(numbers, "dtype", int)).kind
    if kind == "f" and dtype is None:
        return cast(Array, numbers)
    try:
        return jnp.asarray(numbers, dtype or np.float32)
    except (TypeError, ValueError):
        raise BadScene(f"{where} is {shown(numbers)}; give numbers.") from None


def is_traced(tree: object) -> bool:
    """Return whether JAX traces any part."""
    return any(isinstance(leaf, Tracer) for leaf in jax.tree.leaves(tree))


def in_a_row(radius: Float[Array | np.ndarray, "*batch body"]) -> State:
    """Return disks at rest that touch, along the x axis, disk 1 at the origin.

    Args:
        radius: of each disk, m. NumPy's are added in their own precision.
    """
    xp = np if isinstance(radius, np.ndarray) else jnp
    reach = xp.cumsum(radius[..., :-1] + radius[..., 1:], axis=-1)
    x = xp.concatenate([xp.zeros_like(radius[..., :1]), reach], axis=-1)
    behind = xp.stack([-2 * radius[..., 0], 0 * radius[..., 0]], axis=-1)
    return at_rest(
        jnp.asarray(xp.stack([x, 0 * x], axis=-1), jnp.float32),
        jnp.zeros(radius.shape, jnp.float32),
        jnp.asarray(behind, jnp.float32),
    )


def poses_of(state: State) -> Float[np.ndarray, "*batch body 3"]:
    """Return the poses (m, m, rad) as an array of NumPy."""
    return np.concatenate([state.position, state.angle[..., None]], axis=-1)


def pack_motion(state: State) -> Float[Array, "*batch body 6"]:
    """Return x, y, angle and their rates of each disk in one array.

    Datasets and networks use this array.
    """
    rate = jnp.concatenate([state.velocity, state.spin[..., None]], axis=-1)
    return jnp.concatenate([state.pose, rate], axis=-1)


def unpack_motion(
    motion: Float[Array, "*batch body 6"],
    pusher_position: Float[Array, "*batch 2"],
    pusher_velocity: Float[Array, "*batch 2"],
) -> State:
    """Return the state of packed motion; the inverse of `pack_motion`."""
    return State(
        position=motion[..., 0:2],
        angle=motion[..., 2],
        velocity=motion[..., 3:5],
        spin=motion[..., 5],
        pusher_position=pusher_position,
        pusher_velocity=pusher_velocity,
    )


def check_state(state: State, source: str = "state") -> None:
    """Raise `BadScene` if a pose or a velocity is not a finite number."""
    pusher = ("pusher_position", "pusher_velocity")
    for name in ("position", "angle", "velocity", "spin", *pusher):
        if not np.isfinite(np.asarray(getattr(state, name))).all():
            raise BadScene(f"{source}: {name} holds NaN or infinity; give numbers.")
