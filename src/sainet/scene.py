"""What does not move (`Scene`), what does (`State`), and how it moved (`Trajectory`).

Everything is in metres, radians, kilograms and seconds, in the frame of the table.
Leading batch axes are optional; the number of bodies is any number from one up.
"""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from sainet.errors import BadScene

GRAVITY = 9.81  # m/s^2
TIME_STEP = 1 / 240  # s, the paper's


class FrictionField(eqx.Module):
    """A Gaussian random field that multiplies the friction of the table.

    Its value is ``1 + amplitude * sum(cos(wave . p + phase))``, a sum of random
    Fourier features: with waves drawn from a normal distribution of standard
    deviation 1 / length, its correlation is a Gaussian of that length.
    """

    wave: Float[Array, "*batch feature 2"]  # rad/m
    phase: Float[Array, "*batch feature"]  # rad
    amplitude: Float[Array, "*batch"]

    def at(
        self, x: Float[Array, "*batch"], y: Float[Array, "*batch"]
    ) -> Float[Array, "*batch"]:
        """Return the multiplier at a place (m), at least a tenth."""
        phase = (
            self.wave[..., 0] * x[..., None]
            + self.wave[..., 1] * y[..., None]
            + self.phase
        )
        value = 1 + self.amplitude * jnp.sum(jnp.cos(phase), axis=-1)
        return jnp.maximum(value, 0.1)


class Scene(eqx.Module):
    """Disks on a table and the cylinder that pushes them: all that is static."""

    mass: Float[Array, "*batch body"]  # kg
    radius: Float[Array, "*batch body"]  # m
    table_friction: Float[Array, "*batch"]  # between a disk and the table
    disk_friction: Float[Array, "*batch"]  # between two disks
    pusher_friction: Float[Array, "*batch"]  # between the pusher and a disk
    pusher_radius: Float[Array, "*batch"]  # m
    friction_field: FrictionField | None = None
    time_step: float = eqx.field(static=True, default=TIME_STEP)  # s

    @property
    def body_count(self) -> int:
        """The number of disks."""
        return self.mass.shape[-1]

    @property
    def batch_shape(self) -> tuple[int, ...]:
        """The leading axes that all fields share."""
        return self.mass.shape[:-1]


class State(eqx.Module):
    """Where the bodies and the pusher are and how they move."""

    position: Float[Array, "*batch body 2"]  # m
    angle: Float[Array, "*batch body"]  # rad, counter-clockwise, never wrapped
    velocity: Float[Array, "*batch body 2"]  # m/s
    spin: Float[Array, "*batch body"]  # rad/s
    pusher_position: Float[Array, "*batch 2"]  # m
    pusher_velocity: Float[Array, "*batch 2"]  # m/s

    @property
    def body_count(self) -> int:
        """The number of disks."""
        return self.angle.shape[-1]


class Trajectory(eqx.Module):
    """The states after each step; the initial one is not repeated.

    Every field of `states` has a time axis right after the batch axes. In every
    engine and model ``p(t+1) = p(t) + dt * v(t+1)``, penetration recovery included.
    """

    states: State

    @property
    def final(self) -> State:
        """The state after the last step."""
        return _at_step(self.states, -1)

    @property
    def is_finite(self) -> Bool[Array, "*batch time"]:
        """Whether the disks' poses and velocities are numbers, step by step."""
        states = self.states
        pose = jnp.isfinite(states.position).all((-1, -2))
        motion = jnp.isfinite(states.velocity).all((-1, -2))
        turn = jnp.isfinite(states.angle + states.spin).all(-1)
        return pose & motion & turn


def _at_step(states: State, step: int) -> State:
    return State(
        position=states.position[..., step, :, :],
        angle=states.angle[..., step, :],
        velocity=states.velocity[..., step, :, :],
        spin=states.spin[..., step, :],
        pusher_position=states.pusher_position[..., step, :],
        pusher_velocity=states.pusher_velocity[..., step, :],
    )


def at_rest(
    position: Float[Array, "*batch body 2"],
    angle: Float[Array, "*batch body"],
    pusher_position: Float[Array, "*batch 2"],
) -> State:
    """Return the state in which nothing moves."""
    return State(
        position=position,
        angle=angle,
        velocity=jnp.zeros_like(position),
        spin=jnp.zeros_like(angle),
        pusher_position=pusher_position,
        pusher_velocity=jnp.zeros_like(pusher_position),
    )


def pack_motion(state: State) -> Float[Array, "*batch body 6"]:
    """Pack each disk's x, y, angle and their rates into six numbers.

    This one array is what stores and networks work on.
    """
    pose = jnp.concatenate([state.position, state.angle[..., None]], axis=-1)
    rate = jnp.concatenate([state.velocity, state.spin[..., None]], axis=-1)
    return jnp.concatenate([pose, rate], axis=-1)


def unpack_motion(
    motion: Float[Array, "*batch body 6"],
    pusher_position: Float[Array, "*batch 2"],
    pusher_velocity: Float[Array, "*batch 2"],
) -> State:
    """Undo `pack_motion`."""
    return State(
        position=motion[..., 0:2],
        angle=motion[..., 2],
        velocity=motion[..., 3:5],
        spin=motion[..., 5],
        pusher_position=pusher_position,
        pusher_velocity=pusher_velocity,
    )


def pair_gaps(scene: Scene, state: State) -> Float[Array, "*batch body body"]:
    """Return the gaps between the surfaces of the disks (m); negative: overlap.

    The diagonal is infinite.
    """
    offset = state.position[..., :, None, :] - state.position[..., None, :, :]
    squared = jnp.sum(offset**2, axis=-1)
    itself = jnp.broadcast_to(jnp.eye(scene.body_count, dtype=bool), squared.shape)
    distance = jnp.sqrt(jnp.where(itself, 1.0, squared))
    reach = scene.radius[..., :, None] + scene.radius[..., None, :]
    return jnp.where(itself, jnp.inf, distance - reach)


def pusher_gaps(scene: Scene, state: State) -> Float[Array, "*batch body"]:
    """Return the gaps between the pusher and each disk (m); negative: overlap."""
    offset = state.position - state.pusher_position[..., None, :]
    distance = jnp.sqrt(jnp.sum(offset**2, axis=-1))
    return distance - scene.radius - scene.pusher_radius[..., None]


_POSITIVE = ("mass", "radius", "pusher_radius")
_NOT_NEGATIVE = ("table_friction", "disk_friction", "pusher_friction")


def check_scene(scene: Scene, source: str = "scene") -> None:
    """Raise `BadScene` unless every property is a finite number of the right sign.

    Args:
        scene: any batch shape, not traced.
        source: what to name in the message, a file for instance.

    Raises:
        BadScene: with the source, the field, the value and what it must be.
    """
    for name in _POSITIVE + _NOT_NEGATIVE:
        values = np.asarray(getattr(scene, name))
        low = values > 0 if name in _POSITIVE else values >= 0
        good = np.isfinite(values) & low
        if not good.all():
            wanted = "positive" if name in _POSITIVE else "zero or positive"
            value = values[~good].flat[0]
            raise BadScene(f"{source}: {name} is {value}; it must be {wanted}.")


def check_state(state: State, source: str = "state") -> None:
    """Raise `BadScene` if a pose or a velocity is not a finite number."""
    pusher = ("pusher_position", "pusher_velocity")
    for name in ("position", "angle", "velocity", "spin", *pusher):
        if not np.isfinite(np.asarray(getattr(state, name))).all():
            raise BadScene(f"{source}: {name} holds NaN or infinity; remove that push.")
