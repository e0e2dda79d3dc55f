"""Batches of stored pushes, in the types of engines and models."""

from collections.abc import Sequence
from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from sainet.datasets.schema import StoreInfo, simulated_name
from sainet.runs.errors import Diverged
from sainet.scenes.controls import CONTROLS, Controls
from sainet.scenes.scene import Scene
from sainet.scenes.state import State, Trajectory, pack_motion, unpack_motion


class PushBatch(eqx.Module):
    """Pushes of one length: controls, observed motion and simulator prediction."""

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
        """Whether any step of each push was observed."""
        return jnp.any(self.pose_observed | self.rate_observed, axis=-1)


def to_batch(
    arrays: dict[str, np.ndarray],
    info: StoreInfo,
    *,
    steps: int | None = None,
    simulated: str | None = None,
) -> PushBatch:
    """Return a batch of stored arrays.

    Args:
        arrays: arrays of some pushes, by variable name.
        info: attributes of their store.
        steps: number of steps to keep; None for all.
        simulated: internal engine whose prediction to include.
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
    """Return the scenes of stored pushes, without varying table friction."""
    names = ("mass", "radius", "table_friction", "disk_friction", "pusher_friction")
    known: dict[str, Any] = {
        name: jnp.asarray(arrays[name]) for name in (*names, "pusher_radius")
    }
    return Scene(**known, time_step=info.time_step)


def to_initial(arrays: dict[str, np.ndarray]) -> State:
    """Return the initial states of stored pushes, with the pusher at rest."""
    pusher = jnp.asarray(arrays["initial_pusher"])
    return unpack_motion(jnp.asarray(arrays["initial"]), pusher, jnp.zeros_like(pusher))


def to_controls(
    arrays: dict[str, np.ndarray], info: StoreInfo, time: slice = slice(None)
) -> Controls:
    """Return the controls of stored pushes."""
    return CONTROLS[info.kind].from_arrays(
        arrays, time, pusher_mass=info.pusher_mass, damping=info.damping
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
    """Raise `Diverged` if an engine produced NaN or infinity.

    Args:
        engine: its name.
        motion: packed, of each push.
        names: name of each push for the message.

    Raises:
        Diverged: the message names the first such push.
    """
    finite = np.isfinite(motion).all((1, 2, 3))
    if not finite.all():
        raise Diverged(
            f"{names[int(np.argmin(finite))]}: engine {engine} gave NaN or infinity; "
            "check its masses, radii, frictions and path."
        )
