"""A batch of stored pushes as the types that engines and models work on."""

from collections.abc import Sequence
from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from sainet.datasets.schema import StoreInfo, simulated_name
from sainet.runs.errors import Diverged
from sainet.scenes.controls import Controls, ForceControls, PathControls
from sainet.scenes.scene import Scene
from sainet.scenes.state import State, Trajectory, pack_motion, unpack_motion


class PushBatch(eqx.Module):
    """Pushes of one length: what was commanded, what happened, what was predicted."""

    scene: Scene
    initial: State
    controls: Controls
    truth: Float[Array, "push time body 6"]  # packed motion, NaN where unknown
    measured: Float[Array, "push time body 3"]  # pose as captured, NaN where unknown
    pose_observed: Bool[Array, "push time"]
    rate_observed: Bool[Array, "push time"]
    simulated: Float[Array, "push time body 6"] | None  # s-bar, packed motion

    @property
    def size(self) -> int:
        """The number of pushes."""
        return self.truth.shape[0]

    @property
    def is_observed(self) -> Bool[Array, " push"]:
        """Whether anything is known of how each push went."""
        return jnp.any(self.pose_observed | self.rate_observed, axis=-1)


def to_batch(
    arrays: dict[str, np.ndarray],
    info: StoreInfo,
    *,
    steps: int | None = None,
    simulated: str | None = None,
) -> PushBatch:
    """Turn stored arrays into a batch.

    Args:
        arrays: of some pushes, by variable name.
        info: of the store they come from.
        steps: how many steps to keep; None keeps all.
        simulated: the assumed engine whose prediction to take along.
    """
    time = slice(steps)
    truth = arrays["truth"][:, time]
    exists = np.arange(truth.shape[1])[None] < arrays["steps"][:, None]
    return PushBatch(
        scene=to_scene(arrays, info),
        initial=to_initial(arrays),
        controls=to_controls(arrays, info, time),
        truth=jnp.asarray(truth),
        measured=jnp.asarray(arrays.get("measured", arrays["truth"])[:, time, :, :3]),
        pose_observed=jnp.asarray((arrays["pose_observed"][:, time] > 0) & exists),
        rate_observed=jnp.asarray((arrays["rate_observed"][:, time] > 0) & exists),
        simulated=None
        if simulated is None
        else jnp.asarray(arrays[simulated_name(simulated)][:, time]),
    )


def to_scene(arrays: dict[str, np.ndarray], info: StoreInfo) -> Scene:
    """Return the scenes of stored pushes; the field of friction is not known."""
    names = ("mass", "radius", "table_friction", "disk_friction", "pusher_friction")
    known: dict[str, Any] = {
        name: jnp.asarray(arrays[name]) for name in (*names, "pusher_radius")
    }
    return Scene(**known, time_step=info.time_step)


def to_initial(arrays: dict[str, np.ndarray]) -> State:
    """Return the states before stored pushes; the pusher is at rest."""
    pusher = jnp.asarray(arrays["initial_pusher"])
    return unpack_motion(jnp.asarray(arrays["initial"]), pusher, jnp.zeros_like(pusher))


def to_controls(
    arrays: dict[str, np.ndarray], info: StoreInfo, time: slice = slice(None)
) -> Controls:
    """Return the controls of stored pushes."""
    if info.kind == "robot":
        return PathControls(
            position=jnp.asarray(arrays["command_position"][:, time]),
            velocity=jnp.asarray(arrays["command_velocity"][:, time]),
        )
    return ForceControls(
        force=jnp.asarray(arrays["force"][:, time]),
        contact_offset=jnp.asarray(arrays["contact_offset"]),
        pusher_mass=info.pusher_mass,
        damping=info.damping,
    )


def from_trajectory(trajectory: Trajectory) -> tuple[np.ndarray, np.ndarray]:
    """Return a trajectory's packed motion and the pusher's path as NumPy arrays."""
    motion = np.asarray(pack_motion(trajectory.states))
    return motion, np.asarray(trajectory.states.pusher_position)


def check_finite(
    engine: str,
    motion: Float[np.ndarray, "push time body 6"],
    names: Sequence[str],
) -> None:
    """Check that an engine stayed within the numbers.

    Args:
        engine: its name.
        motion: packed, of each push.
        names: what the user knows each push by.

    Raises:
        Diverged: it left them; the message names the first push in which it did.
    """
    finite = np.isfinite(motion).all((1, 2, 3))
    if not finite.all():
        raise Diverged(
            f"{names[int(np.argmin(finite))]}: the engine {engine} left the numbers; "
            "check its masses, radii, frictions and path."
        )
