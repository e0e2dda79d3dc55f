"""Pushes: their parameters, the grid of 72, the pusher's start and the commands."""

import math

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax import dtypes
from jaxtyping import Array, Float

from sainet.runs.errors import BadScene
from sainet.scenes import quantities
from sainet.scenes.controls import ForceControls, PathControls
from sainet.scenes.geometry import direction, unit
from sainet.scenes.quantities import require_count
from sainet.scenes.scene import Scene
from sainet.scenes.state import Numbers, State, at_rest, floats, is_traced

_TO_REST = 32 / 240  # s, after a push, at least
_BRAKING = 1.0  # m/s^2, of a disk that slides on a smooth table
_PARAMETERS = {
    "contact_angle": quantities.CONTACT_ANGLE,
    "direction": quantities.DIRECTION,
    "length": quantities.STROKE,
    "speed": quantities.SPEED,
}


class Push(eqx.Module):
    """A straight push: where it starts on the disk, where it goes and how fast.

    The contact angle is about the axis from disk 1 to disk 2 (one disk: the table's
    x axis), measured from the back of disk 1; the direction is from the normal.

    Attributes:
        contact_angle: where the pusher touches disk 1 (rad); a scalar, of a batch
            [push], as all others.
        direction: of the pusher's motion, from the contact normal (rad).
        length: of the stroke (m).
        speed: of the pusher (m/s).
    """

    contact_angle: Float[Array, "*batch"]
    direction: Float[Array, "*batch"]
    length: Float[Array, "*batch"]
    speed: Float[Array, "*batch"]

    def __init__(
        self,
        contact_angle: Numbers,
        direction: Numbers = 0.0,
        length: Numbers = 0.010,
        speed: Numbers = 0.050,
    ) -> None:
        """Return a push, or a batch of pushes.

        Args:
            contact_angle: rad. Numbers, lists and arrays are broadcast against each
                other; numbers and lists are single precision.
            direction: rad.
            length: m.
            speed: m/s.

        Raises:
            BadScene: these are not numbers, or their shapes do not fit each other.
        """
        given = contact_angle, direction, length, speed
        kinds = [np.dtype(getattr(each, "dtype", np.float32)) for each in given]
        found = [kind for kind in kinds if kind.kind == "f"] or [np.float32]
        kind = dtypes.canonicalize_dtype(np.result_type(*found))
        named = zip(_PARAMETERS, given, strict=True)
        arrays = [floats(each, f"push: {name}", kind) for name, each in named]
        shapes = [each.shape for each in arrays]
        try:
            arrays = jnp.broadcast_arrays(*arrays)
        except ValueError:
            raise BadScene(
                f"push: contact_angle, direction, length and speed have the shapes "
                f"{shapes}; give equal ones, or numbers."
            ) from None
        self.contact_angle, self.direction, self.length, self.speed = arrays


class PushGrid(eqx.Module):
    """The paper's 12 by 6 pushes: midpoints of the bins of both angles.

    Attributes:
        contact_bins: number of contact angles.
        direction_bins: number of push directions.
        contact_range: of contact angles, to either side (rad).
        direction_range: of push directions, to either side (rad).
        length: of each push (m).
        speed: of each push (m/s).
    """

    contact_bins: int = 12
    direction_bins: int = 6
    contact_range: float = np.pi / 3
    direction_range: float = np.pi / 6
    length: float = 0.010
    speed: float = 0.050

    def __check_init__(self) -> None:
        """Refuse numbers of angles that are no whole numbers from 1."""
        require_count("contact_bins", self.contact_bins)
        require_count("direction_bins", self.direction_bins)

    def pushes(self) -> Push:
        """Return all pushes as one batch, the directions running fastest."""
        contact = _midpoints(self.contact_bins, self.contact_range)
        angle = _midpoints(self.direction_bins, self.direction_range)
        contact, angle = jnp.meshgrid(contact, angle, indexing="ij")
        return Push(contact.ravel(), angle.ravel(), self.length, self.speed)


def _midpoints(bins: int, reach: float) -> Float[Array, " bin"]:
    return (jnp.arange(bins) + 0.5) / bins * (2 * reach) - reach


def push_axis(state: State) -> Float[Array, "*batch"]:
    """Return the angle of the axis that contact angles are measured about (rad)."""
    if state.body_count == 1:
        return jnp.zeros_like(state.angle[..., 0])
    return direction(state.position[..., 1, :] - state.position[..., 0, :])


def place_pusher(
    scene: Scene, state: State, push: Push, *, gap: float = 0.0
) -> Float[Array, "*batch 2"]:
    """Return where the pusher starts (m): on disk 1, `gap` away from its surface."""
    normal = unit(push_axis(state) + push.contact_angle)
    reach = scene.radius[..., 0] + scene.pusher_radius + gap
    return state.position[..., 0, :] - reach[..., None] * normal


def push_direction(state: State, push: Push) -> Float[Array, "*batch 2"]:
    """Return the unit vector along which the pusher moves or pushes."""
    return unit(push_axis(state) + push.contact_angle + push.direction)


def check_push(push: Push) -> None:
    """Raise `BadScene` for a parameter that is out of range; traced ones are not."""
    for name, quantity in _PARAMETERS.items():
        if not is_traced(value := getattr(push, name)):
            quantity.check(value, f"push: {name}", error=BadScene)


def settled_steps(push: Push, time_step: float) -> int:
    """Return the steps until pushes have ended and everything rests; not traced."""
    check_push(push)
    length, speed = np.asarray(push.length), np.asarray(push.speed)
    step = float(time_step)
    moving = float(np.max(length / speed, initial=0.0))
    resting = float(np.max(speed / _BRAKING, initial=_TO_REST))
    # A hair less than exact: 48.00001 steps of motion are 48.
    return math.ceil(moving / step - 1e-3) + round(resting / step)


def command_path(
    scene: Scene, state: State, push: Push, *, steps: int, gap: float = 0.0
) -> tuple[State, PathControls]:
    """Place the pusher and command a straight push that then holds.

    Args:
        scene: of each push.
        state: observed poses of the disks.
        push: one for each scene.
        steps: length of the controls, holding included.
        gap: between the pusher and disk 1 at the start, m.

    Returns:
        The state at rest with the pusher at the start, and the controls.
    """
    initial, heading = _placed(scene, state, push, gap), push_direction(state, push)
    end_of_step = jnp.arange(1, steps + 1) * scene.time_step
    distance = jnp.multiply.outer(push.speed, end_of_step)
    travelled = jnp.minimum(distance, push.length[..., None])
    before = jnp.concatenate([jnp.zeros_like(travelled[..., :1]), travelled], -1)[
        ..., :-1
    ]
    speed = (travelled - before) / scene.time_step
    along = travelled[..., None] * heading[..., None, :]
    return initial, PathControls(
        position=initial.pusher_position[..., None, :] + along,
        velocity=speed[..., None] * heading[..., None, :],
    )


def command_force(
    scene: Scene,
    state: State,
    push: Push,
    *,
    force: float,
    steps: int,
    gap: float = 0.0,
) -> tuple[State, ForceControls]:
    """Place the pusher and command a constant force along the push direction.

    Args:
        scene: of each push.
        state: observed poses of the disks.
        push: one for each scene; its length and speed have no effect.
        force: N.
        steps: length of the controls.
        gap: between the pusher and disk 1 at the start, m.

    Returns:
        The state at rest with the pusher at the start, and the controls.
    """
    initial, heading = _placed(scene, state, push, gap), push_direction(state, push)
    shape = (*heading.shape[:-1], steps, 2)
    return initial, ForceControls(
        force=jnp.broadcast_to(force * heading[..., None, :], shape),
        contact_offset=initial.pusher_position - initial.position[..., 0, :],
    )


def _placed(scene: Scene, state: State, push: Push, gap: float) -> State:
    return at_rest(
        state.position, state.angle, place_pusher(scene, state, push, gap=gap)
    )
