"""Commands to the pusher over time, one class for each setup."""

import math
from abc import abstractmethod
from collections.abc import Mapping
from types import MappingProxyType
from typing import ClassVar, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from sainet.scenes.geometry import rotate
from sainet.scenes.state import numbers


class Pusher(NamedTuple):
    """How the pusher resists a force."""

    mass: float  # kg; infinite: contacts do not slow it
    damping: float  # N s/m


XY = tuple[Array, Array]  # one array for each axis
Arrays = Mapping[str, np.ndarray]  # stored, by name
Vector = Float[Array, "*batch 2"]
Vectors = Float[Array, "*batch time 2"]  # one for each step
Angle = Float[Array, "*batch"]  # rad


class Controls(eqx.Module):
    """Commands to the pusher, step by step; leading batch axes are optional."""

    kind: ClassVar[str]  # the setup: a key of `CONTROLS`

    @property
    @abstractmethod
    def pusher(self) -> Pusher:
        """The mass and the damping of the pusher."""

    @property
    def steps(self) -> int:
        """The number of steps."""
        return self.command.shape[-2]

    @property
    @abstractmethod
    def command(self) -> Vectors:
        """The command of each step, which `drive` takes: m or N."""

    @property
    @abstractmethod
    def action(self) -> Float[Array, "*batch time action"]:
        """Inputs of a network that depend on the commands only."""

    @property
    @abstractmethod
    def pusher_path(self) -> Vectors | None:
        """Commanded pusher position (m) after each step; None: not commanded."""

    @abstractmethod
    def pusher_motion(self, start: Vector) -> tuple[Vectors, Vectors]:
        """Return the pusher's position (m) and velocity (m/s) without simulation.

        Args:
            start: its position before the first step, m.
        """

    @abstractmethod
    def drive(self, position: XY, velocity: XY, command: XY, time_step: float) -> XY:
        """Return the pusher's velocity (m/s) in one step without contact.

        Args:
            position: of the pusher before the step, m.
            velocity: of the pusher before the step, m/s.
            command: one step of `command`.
            time_step: s.
        """

    @abstractmethod
    def with_command(self, command: Vectors) -> "Controls":
        """Return controls with another command, for example with errors."""

    @abstractmethod
    def moved(self, offset: Vector) -> "Controls":
        """Return controls of a pusher displaced relative to the disks by `offset` (m).

        Args:
            offset: one for all pushes, or one for each.
        """

    def turned(self, angle: Angle) -> "Controls":
        """Return controls turned about the table's origin (rad)."""

        def turn(vector: Array) -> Array:
            later = (1,) * (vector.ndim - 1 - angle.ndim)
            return rotate(vector, angle.reshape(angle.shape + later))

        return jax.tree.map(turn, self)  # every array is a vector

    def mirrored(self) -> "Controls":
        """Return controls mirrored at the table's x axis."""
        return jax.tree.map(lambda vector: vector.at[..., 1].multiply(-1), self)

    @abstractmethod
    def in_frame(self, origin: Vector, angle: Angle) -> "Controls":
        """Return controls in a frame with this origin (m) and x axis (rad)."""

    @abstractmethod
    def arrays(self) -> dict[str, Array]:
        """Return the stored arrays by name."""

    @classmethod
    @abstractmethod
    def from_arrays(cls, arrays: Arrays, pusher: Pusher) -> "Controls":
        """Return the controls of stored pushes.

        Args:
            arrays: as `arrays` returns them.
            pusher: where a force drives it.
        """


class PathControls(Controls):
    """The pusher follows a path (the robot setup).

    Attributes:
        position: commanded at the end of each step, [time, 2] (m); of a batch
            [push, time, 2].
        velocity: commanded during each step, [time, 2] (m/s).
    """

    position: Vectors = eqx.field(converter=numbers("push: position"))
    velocity: Vectors = eqx.field(converter=numbers("push: velocity"))

    kind: ClassVar[str] = "robot"

    @property
    def pusher(self) -> Pusher:
        """A pusher that stays on its path."""
        return Pusher(math.inf, 0.0)

    @property
    def command(self) -> Vectors:
        """The position at the end of each step, m."""
        return self.position

    @property
    def action(self) -> Vectors:
        """The commanded velocity, m/s."""
        return self.velocity

    @property
    def pusher_path(self) -> Vectors:
        """The commanded positions, m."""
        return self.position

    def pusher_motion(self, start: Vector) -> tuple[Vectors, Vectors]:
        """Return the commanded positions and velocities."""
        return self.position, self.velocity

    def drive(self, position: XY, velocity: XY, command: XY, time_step: float) -> XY:
        """Return the velocity that ends the step on the path."""
        (x, y), (next_x, next_y) = position, command
        return (next_x - x) / time_step, (next_y - y) / time_step

    def with_command(self, command: Vectors) -> "PathControls":
        """Return another path; the commanded velocity stays."""
        return PathControls(command, self.velocity)

    def moved(self, offset: Vector) -> "PathControls":
        """Return a displaced path."""
        offset = jnp.broadcast_to(offset[..., None, :], self.position.shape)
        return PathControls(self.position + offset, self.velocity)

    def in_frame(self, origin: Vector, angle: Angle) -> Controls:
        """Return the path in the frame."""
        return self.moved(-origin).turned(-angle)

    def arrays(self) -> dict[str, Array]:
        """Return the stored arrays by name."""
        return {"command_position": self.position, "command_velocity": self.velocity}

    @classmethod
    def from_arrays(cls, arrays: Arrays, pusher: Pusher) -> "PathControls":
        """Return the paths of stored pushes; the pusher stays on them."""
        names = ("command_position", "command_velocity")
        return cls(*(jnp.asarray(arrays[name]) for name in names))


class ForceControls(Controls):
    """A force drives the pusher against a viscous damper (the direct-force setup).

    Attributes:
        force: during each step, [time, 2] (N); of a batch [push, time, 2].
        contact_offset: pusher minus disk 1 at the start, [2] (m).
        pusher_mass: kg.
        damping: N s/m.
    """

    force: Vectors = eqx.field(converter=numbers("push: force"))
    contact_offset: Vector = eqx.field(converter=numbers("push: contact_offset"))
    pusher_mass: float = eqx.field(static=True, default=10.0)
    damping: float = eqx.field(static=True, default=1000.0)

    kind: ClassVar[str] = "direct-force"

    @property
    def pusher(self) -> Pusher:
        """The mass and the damping of the pusher."""
        return Pusher(self.pusher_mass, self.damping)

    @property
    def command(self) -> Vectors:
        """The force during each step, N."""
        return self.force

    @property
    def action(self) -> Float[Array, "*batch time 4"]:
        """The force (N) and the contact offset (m)."""
        offset = jnp.broadcast_to(self.contact_offset[..., None, :], self.force.shape)
        return jnp.concatenate([self.force, offset], axis=-1)

    @property
    def pusher_path(self) -> None:
        """None: where the pusher moves depends on the disks."""

    def pusher_motion(self, start: Vector) -> tuple[Vectors, Vectors]:
        """Return a pusher that stays at the start: the commands imply no motion."""
        shape = self.force.shape
        return jnp.broadcast_to(start[..., None, :], shape), jnp.zeros(shape)

    def drive(self, position: XY, velocity: XY, command: XY, time_step: float) -> XY:
        """Return v + dt / M (f - c v), an explicit step against the damper."""
        gain = time_step / self.pusher_mass
        keep = 1 - gain * self.damping
        (vx, vy), (x, y) = velocity, command
        return keep * vx + gain * x, keep * vy + gain * y

    def with_command(self, command: Vectors) -> "ForceControls":
        """Return other forces."""
        return eqx.tree_at(lambda c: c.force, self, command)

    def moved(self, offset: Vector) -> "ForceControls":
        """Return forces with a displaced point of contact."""
        offset = jnp.broadcast_to(offset, self.contact_offset.shape)
        return eqx.tree_at(
            lambda c: c.contact_offset, self, self.contact_offset + offset
        )

    def in_frame(self, origin: Vector, angle: Angle) -> Controls:
        """Return forces and points of contact in the frame: from its disk."""
        return self.turned(-angle)

    def arrays(self) -> dict[str, Array]:
        """Return the stored arrays by name."""
        return {"force": self.force, "contact_offset": self.contact_offset}

    @classmethod
    def from_arrays(cls, arrays: Arrays, pusher: Pusher) -> "ForceControls":
        """Return the forces of stored pushes."""
        force, offset = (jnp.asarray(arrays[n]) for n in ("force", "contact_offset"))
        return cls(force, offset, pusher.mass, pusher.damping)


CONTROLS: Mapping[str, type[Controls]] = MappingProxyType(
    {each.kind: each for each in (PathControls, ForceControls)}
)
