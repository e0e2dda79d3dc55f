"""States of disks and pusher, and trajectories of states.

Units are metres, radians, kilograms and seconds, in the table frame.
"""

from collections.abc import Callable, Mapping, Sequence
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


def floats(
    numbers: Numbers, where: str, dtype: type[np.floating] | np.dtype | None = None
) -> Array:
    """Return numbers as an array of their own, which may be traced.

    Args:
        numbers: floating-point numbers keep their precision without `dtype`.
        where: the argument, as messages name it.
        dtype: of the array; None: single precision.

    Raises:
        BadScene: they are not numbers.
    """
    try:
        if dtype is None and _are_floats(numbers):
            return numbers if isinstance(numbers, Array) else jnp.array(numbers)
        return jnp.array(numbers, dtype or np.float32)  # `asarray` may share memory
    except (TypeError, ValueError):
        raise BadScene(f"{where} is {shown(numbers)}; give numbers.") from None


def require_shapes(
    part: object, where: str, wanted: Mapping[str, tuple[int, ...]]
) -> None:
    """Raise `BadScene` unless fields have these shapes; `where` names the part."""
    for name, shape in wanted.items():
        if (found := np.shape(getattr(part, name))) != shape:
            raise BadScene(
                f"{where}: {name} has the shape {list(found)}; here it must be "
                f"{list(shape)}."
            )


def numbers(where: str) -> Callable[[Numbers], Array]:
    """Return `floats` for a field, which messages name so; arrays of floats stay."""
    return lambda x: cast(Array, x) if _are_floats(x) else floats(x, where)


def _are_floats(numbers: Numbers) -> bool:
    return np.dtype(getattr(numbers, "dtype", int)).kind == "f"


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

    position: Float[Array, "*batch body 2"] = eqx.field(
        converter=numbers("state: position")
    )
    angle: Float[Array, "*batch body"] = eqx.field(converter=numbers("state: angle"))
    velocity: Float[Array, "*batch body 2"] = eqx.field(
        converter=numbers("state: velocity")
    )
    spin: Float[Array, "*batch body"] = eqx.field(converter=numbers("state: spin"))
    pusher_position: Float[Array, "*batch 2"] = eqx.field(
        converter=numbers("state: pusher")
    )
    pusher_velocity: Float[Array, "*batch 2"] = eqx.field(
        converter=numbers("state: pusher")
    )

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

    Raises:
        BadScene: these are not numbers, or their shapes do not fit each other.
    """
    position = floats(position, "state: position")
    angle = floats(angle, "state: angle")
    pusher_position = floats(pusher_position, "state: pusher_position")
    found = State(
        position=position,
        angle=angle,
        velocity=jnp.zeros_like(position),
        spin=jnp.zeros_like(angle),
        pusher_position=pusher_position,
        pusher_velocity=jnp.zeros_like(pusher_position),
    )
    check_shapes(found)
    return found


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


def check_shapes(state: State, source: str = "state") -> None:
    """Raise `BadScene` unless all fields have the axes of the angles."""
    axes = np.shape(state.angle) or (1,)
    body, pusher = (*axes, 2), (*axes[:-1], 2)
    wanted = {"position": body, "angle": axes, "velocity": body, "spin": axes}
    wanted |= {"pusher_position": pusher, "pusher_velocity": pusher}
    require_shapes(state, source, wanted)


def check_state(state: State, source: str = "state") -> None:
    """Raise `BadScene` if a pose or a velocity is not a finite number."""
    pusher = ("pusher_position", "pusher_velocity")
    for name in ("position", "angle", "velocity", "spin", *pusher):
        if not np.isfinite(np.asarray(getattr(state, name))).all():
            raise BadScene(f"{source}: {name} holds NaN or infinity; give numbers.")
