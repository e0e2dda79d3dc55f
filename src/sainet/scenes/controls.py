"""Commands to the pusher over time, one class for each setup."""

from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from sainet.scenes.pushes import Push
from sainet.scenes.state import State


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
