"""Static properties of disks on a table and of the pusher, and gaps between them.

Units are metres, radians, kilograms and seconds, in the table frame. Leading batch axes
are optional; there is at least one disk.
"""

from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike
from jaxtyping import Array, Float

from sainet.runs.errors import BadScene, shown
from sainet.scenes.quantities import PROPERTIES, TIME_STEP_RANGE
from sainet.scenes.state import (
    Numbers,
    State,
    floats,
    in_a_row,
    is_traced,
    numbers,
    require_shapes,
)

GRAVITY = 9.81  # m/s^2
TIME_STEP = 1 / 240  # s, the paper's
PUSHER_RADIUS = 0.0048  # m, the paper's


class FrictionField(eqx.Module):
    """A Gaussian random field that multiplies table friction.

    Its value is ``1 + amplitude * sum(cos(wave . p + phase))``, a sum of random
    Fourier features. With waves from a normal distribution of standard deviation
    1 / length, its correlation is a Gaussian of that length.

    Attributes:
        wave: [feature, 2] (rad/m).
        phase: [feature] (rad).
        amplitude: a scalar without a unit.
    """

    wave: Float[Array, "*batch feature 2"]
    phase: Float[Array, "*batch feature"]
    amplitude: Float[Array, "*batch"]

    def at(
        self, x: Float[Array, "*batch"], y: Float[Array, "*batch"]
    ) -> Float[Array, "*batch"]:
        """Return the multiplier at a position (m), at least 0.1."""
        phase = (
            self.wave[..., 0] * x[..., None]
            + self.wave[..., 1] * y[..., None]
            + self.phase
        )
        value = 1 + self.amplitude * jnp.sum(jnp.cos(phase), axis=-1)
        return jnp.maximum(value, 0.1)


class Scene(eqx.Module):
    """Static properties of disks on a table and of the pusher.

    Batches of scenes have a leading axis, push, in every array.

    Attributes:
        mass: of each disk, [body] (kg).
        radius: of each disk, [body] (m).
        table_friction: between a disk and the table; a scalar, as all further ones.
        disk_friction: between two disks.
        pusher_friction: between the pusher and a disk.
        pusher_radius: m.
        friction_field: multiplies table friction from place to place; None: even.
        time_step: s, one number for a batch.
    """

    mass: Float[Array, "*batch body"] = eqx.field(converter=numbers("scene: mass"))
    radius: Float[Array, "*batch body"] = eqx.field(converter=numbers("scene: radius"))
    table_friction: Float[Array, "*batch"] = eqx.field(
        converter=numbers("scene: table_friction")
    )
    disk_friction: Float[Array, "*batch"] = eqx.field(
        converter=numbers("scene: disk_friction")
    )
    pusher_friction: Float[Array, "*batch"] = eqx.field(
        converter=numbers("scene: pusher_friction")
    )
    pusher_radius: Float[Array, "*batch"] = eqx.field(
        converter=numbers("scene: pusher_radius")
    )
    friction_field: FrictionField | None = None
    time_step: float = eqx.field(static=True, default=TIME_STEP)

    @classmethod
    def disks(
        cls,
        mass: Numbers,
        radius: Numbers,
        *,
        table_friction: ArrayLike = 0.15,
        disk_friction: ArrayLike = 0.25,
        pusher_friction: ArrayLike = 0.25,
        pusher_radius: ArrayLike = PUSHER_RADIUS,
        time_step: float = TIME_STEP,
    ) -> "Scene":
        """Return one scene from plain numbers.

        JAX may trace them: `jax.vmap` over masses makes a batch of scenes. Traced
        values are not checked.

        Args:
            mass: of each disk, kg. One number is that of all disks, of which there is
                one if `radius` is a number, too.
            radius: of each disk, m; or one number.
            table_friction: between a disk and the table.
            disk_friction: between two disks.
            pusher_friction: between the pusher and a disk.
            pusher_radius: m.
            time_step: s.

        Raises:
            BadScene: a value is out of its range, or masses and radii differ in number.
        """
        disks = {"mass": mass, "radius": radius}
        counts = [_count(*each) for each in disks.items()]
        count = max(*counts, 1)
        if not {*counts} <= {0, count}:
            raise BadScene(
                f"scene: it has {counts[0]} masses and {counts[1]} radii; give one "
                "of each for every disk."
            )
        single = {
            "table_friction": table_friction,
            "disk_friction": disk_friction,
            "pusher_friction": pusher_friction,
            "pusher_radius": pusher_radius,
        }
        for name, value in single.items():
            if np.ndim(value):
                raise BadScene(f"scene: {name} is {shown(value)}; give one number.")
        shapes = {**dict.fromkeys(disks, (count,)), **dict.fromkeys(single, ())}
        fields: dict[str, Any] = {
            name: jnp.broadcast_to(
                floats(each, f"scene: {name}", np.float32), shapes[name]
            )
            for name, each in (disks | single).items()
        }
        scene = cls(**fields, time_step=time_step)
        if not is_traced(fields):
            check_scene(scene)
        return scene

    def in_a_row(self) -> State:
        """Return the disks at rest, touching along the x axis, disk 1 at the origin.

        The pusher is behind disk 1 without touching it.
        """
        return _row(self.radius)

    @property
    def body_count(self) -> int:
        """The number of disks."""
        return self.mass.shape[-1]

    @property
    def batch_shape(self) -> tuple[int, ...]:
        """The leading axes that all fields share."""
        return self.mass.shape[:-1]


def _count(name: str, values: Any) -> int:  # noqa: ANN401
    """Return the number of disks that have a value, 0 for one number for all.

    Raises:
        BadScene: no disk has one, or the values are not one for each disk.
    """
    shape = np.shape(values)
    if len(shape) > 1 or 0 in shape:
        raise BadScene(
            f"scene: {name} has the shape {list(shape)}; give one number for each "
            "disk, or one for all."
        )
    return shape[0] if shape else 0


_row = eqx.filter_jit(in_a_row)  # a dozen small operations in one


def check_axes_of(scene: Scene) -> None:
    """Raise `BadScene` unless all fields have the axes of the masses."""
    axes = np.shape(scene.mass) or (1,)
    single = {each: axes[:-1] for each in PROPERTIES if np.ndim(getattr(scene, each))}
    require_shapes(scene, "scene", single | {"mass": axes, "radius": axes})


def check_scene(scene: Scene, source: str = "scene") -> None:
    """Raise `BadScene` unless every property is in its range.

    Args:
        scene: any batch shape, not traced.
        source: named in the message, a file for example.

    Raises:
        BadScene: with the source, the field, the value and its range.
    """
    for name, quantity in PROPERTIES.items():
        where = f"{source}: {name}"
        quantity.check(getattr(scene, name), where, error=BadScene)
    TIME_STEP_RANGE.check(scene.time_step, f"{source}: time_step", error=BadScene)


def pair_gaps(scene: Scene, state: State) -> Float[Array, "*batch body body"]:
    """Return the gaps between the surfaces of disks (m), negative for overlaps.

    The diagonal is infinite.
    """
    offset = state.position[..., :, None, :] - state.position[..., None, :, :]
    squared = jnp.sum(offset**2, axis=-1)
    itself = jnp.broadcast_to(jnp.eye(scene.body_count, dtype=bool), squared.shape)
    distance = jnp.sqrt(jnp.where(itself, 1.0, squared))
    reach = scene.radius[..., :, None] + scene.radius[..., None, :]
    return jnp.where(itself, jnp.inf, distance - reach)


def pusher_gaps(scene: Scene, state: State) -> Float[Array, "*batch body"]:
    """Return the gaps between the pusher and each disk (m), negative for overlaps."""
    offset = state.position - state.pusher_position[..., None, :]
    distance = jnp.sqrt(jnp.sum(offset**2, axis=-1))
    return distance - scene.radius - scene.pusher_radius[..., None]
