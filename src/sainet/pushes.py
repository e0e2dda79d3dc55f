"""A push, the grid of 72 pushes, and a push as controls over time."""

from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from sainet.geometry import direction, unit
from sainet.scene import Scene, State


class Push(eqx.Module):
    """A straight push: where it starts on the disk, where it goes and how fast.

    The contact angle is about the axis from disk 1 to disk 2 (one disk: the table's
    x axis), measured from the back of disk 1; the direction is from the normal.
    """

    contact_angle: Float[Array, "*batch"]  # rad
    direction: Float[Array, "*batch"]  # rad
    length: Float[Array, "*batch"]  # m
    speed: Float[Array, "*batch"]  # m/s


class PathControls(eqx.Module):
    """The pusher follows a path (the robot setup)."""

    position: Float[Array, "*batch time 2"]  # m, commanded at the end of each step
    velocity: Float[Array, "*batch time 2"]  # m/s, commanded during each step

    kind: ClassVar[str] = "robot"

    @property
    def steps(self) -> int:
        """The number of steps."""
        return self.velocity.shape[-2]


class ForceControls(eqx.Module):
    """A force drives the pusher against a viscous damper (the direct-force setup)."""

    force: Float[Array, "*batch time 2"]  # N
    contact_offset: Float[Array, "*batch 2"]  # m, pusher minus disk at the start
    pusher_mass: float = eqx.field(static=True, default=10.0)  # kg
    damping: float = eqx.field(static=True, default=1000.0)  # N s/m

    kind: ClassVar[str] = "direct-force"

    @property
    def steps(self) -> int:
        """The number of steps."""
        return self.force.shape[-2]


Controls = PathControls | ForceControls


class PushGrid(eqx.Module):
    """The paper's 12 by 6 pushes: midpoints of the bins of both angles."""

    contact_bins: int = 12
    direction_bins: int = 6
    contact_range: float = np.pi / 3  # rad, to either side
    direction_range: float = np.pi / 6  # rad, to either side
    length: float = 0.010  # m
    speed: float = 0.050  # m/s

    def pushes(self) -> Push:
        """Return all pushes as one batch, the directions running fastest."""
        contact = _midpoints(self.contact_bins, self.contact_range)
        angle = _midpoints(self.direction_bins, self.direction_range)
        contact, angle = jnp.meshgrid(contact, angle, indexing="ij")
        same = jnp.ones(contact.size)
        return Push(
            contact_angle=contact.ravel(),
            direction=angle.ravel(),
            length=self.length * same,
            speed=self.speed * same,
        )


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


def path_controls(
    push: Push,
    start: Float[Array, "*batch 2"],
    heading: Float[Array, "*batch 2"],
    *,
    steps: int,
    time_step: float,
) -> PathControls:
    """Return a push at constant speed along a line that then holds.

    Args:
        push: its length and speed are used.
        start: where the pusher starts, m.
        heading: unit vector.
        steps: how many steps the controls last, holding included.
        time_step: s.
    """
    end_of_step = jnp.arange(1, steps + 1) * time_step
    asked = jnp.multiply.outer(push.speed, end_of_step)
    travelled = jnp.minimum(asked, push.length[..., None])
    before = jnp.concatenate([jnp.zeros_like(travelled[..., :1]), travelled], -1)[
        ..., :-1
    ]
    speed = (travelled - before) / time_step
    return PathControls(
        position=start[..., None, :] + travelled[..., None] * heading[..., None, :],
        velocity=speed[..., None] * heading[..., None, :],
    )


def force_controls(
    state: State, heading: Float[Array, "*batch 2"], *, force: float, steps: int
) -> ForceControls:
    """Return a constant force (N) along a heading for so many steps."""
    batch = heading.shape[:-1]
    return ForceControls(
        force=jnp.broadcast_to(force * heading[..., None, :], (*batch, steps, 2)),
        contact_offset=state.pusher_position - state.position[..., 0, :],
    )


def move_pusher(state: State, offset: Float[Array, "*batch 2"]) -> State:
    """Return states with the pusher moved by an offset (m), one or one for each."""
    moved = state.pusher_position + jnp.broadcast_to(
        offset, state.pusher_position.shape
    )
    return eqx.tree_at(lambda s: s.pusher_position, state, moved)


def move_controls(controls: Controls, offset: Float[Array, "*batch 2"]) -> Controls:
    """Return controls of a pusher that is moved by an offset (m)."""
    if isinstance(controls, ForceControls):
        here = jnp.broadcast_to(offset, controls.contact_offset.shape)
        contact = controls.contact_offset + here
        return eqx.tree_at(lambda c: c.contact_offset, controls, contact)
    path = controls.position
    path = path + jnp.broadcast_to(offset[..., None, :], path.shape)
    return eqx.tree_at(lambda c: c.position, controls, path)
