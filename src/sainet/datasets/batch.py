"""Batches of stored pushes in the types of models, and their simulator predictions."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from sainet.datasets import schema
from sainet.engines.base import roll_out
from sainet.engines.simulator import InternalEngine, SimulatorSpec
from sainet.runs.errors import Diverged
from sainet.scenes.controls import CONTROLS, Controls, Pusher
from sainet.scenes.quantities import PROPERTIES
from sainet.scenes.recording import CameraOffset
from sainet.scenes.scene import Scene
from sainet.scenes.state import State, Trajectory, pack_motion, unpack_motion

_LENGTHS = 2  # of pushes, at most, that programs are compiled for


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

    def seen_by(self, camera: CameraOffset) -> "PushBatch":
        """Return the batch with the pusher where a camera would measure it."""
        if not camera:
            return self
        offset = jnp.array(camera.vector)
        initial = self.initial.with_pusher_moved(offset)
        return replace(self, initial=initial, controls=self.controls.moved(offset))


def to_batch(
    arrays: schema.Arrays,
    info: schema.StoreInfo,
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
    known = schema.variables(info)
    timed = {name for name, each in known.items() if "time" in each.dimensions}
    # A computed prediction is no variable of the store.
    predicted = schema.simulated_name(simulated) if simulated else ""
    cut = {
        name: array[:, :steps] if name in timed or name == predicted else array
        for name, array in arrays.items()
    }
    exists = np.arange(cut["truth"].shape[1])[None] < arrays["steps"][:, None]
    return PushBatch(
        scene=to_scene(arrays, info),
        initial=to_initial(arrays),
        controls=to_controls(cut, info),
        truth=jnp.asarray(cut["truth"]),
        measured=jnp.asarray(cut.get("measured", cut["truth"])[..., :3]),
        pose_observed=jnp.asarray((cut["pose_observed"] > 0) & exists),
        rate_observed=jnp.asarray((cut["rate_observed"] > 0) & exists),
        simulated=jnp.asarray(cut[predicted]) if simulated else None,
    )


def shared_lengths(steps: Int[np.ndarray, " push"]) -> Int[np.ndarray, " push"]:
    """Return the steps that pushes are read for: two numbers, at most.

    Programs are compiled for each length. What follows the end of a push is unobserved.
    """
    longest = int(steps.max())
    unit = -(-longest // _LENGTHS)
    return np.minimum(-(-steps // unit) * unit, longest)


def to_scene(arrays: schema.Arrays, info: schema.StoreInfo) -> Scene:
    """Return the scenes of stored pushes, without varying table friction."""
    known = {name: jnp.asarray(arrays[name]) for name in PROPERTIES}
    return Scene(**known, friction_field=None, time_step=info.time_step)


def to_initial(arrays: schema.Arrays) -> State:
    """Return the initial states of stored pushes, with the pusher at rest."""
    pusher = jnp.asarray(arrays["initial_pusher"])
    return unpack_motion(jnp.asarray(arrays["initial"]), pusher, jnp.zeros_like(pusher))


def to_controls(arrays: schema.Arrays, info: schema.StoreInfo) -> Controls:
    """Return the controls of stored pushes."""
    pusher = Pusher(info.pusher_mass, info.damping)
    return CONTROLS[info.kind].from_arrays(arrays, pusher)


def from_trajectory(trajectory: Trajectory) -> tuple[np.ndarray, np.ndarray]:
    """Return a trajectory's packed motion and the pusher's path as NumPy arrays."""
    motion = np.asarray(pack_motion(trajectory.states))
    return motion, np.asarray(trajectory.states.pusher_position)


@dataclass(frozen=True)
class Prediction:
    """The simulator prediction (s-bar) of one internal engine for stored pushes.

    It is read if the store contains the prediction of an equal specification (engine
    version included) for the same path of the pusher; otherwise it is computed.
    """

    internal: InternalEngine
    info: schema.StoreInfo  # of the pushes

    @property
    def name(self) -> str:
        """The name of its array."""
        return schema.simulated_name(self.internal.simulator.stored_as)

    @property
    def is_stored(self) -> bool:
        """Whether the store contains the prediction."""
        # A camera offset displaces the pusher.
        return not self.internal.camera and self.name in schema.variables(self.info)

    @property
    def names(self) -> tuple[str, ...]:
        """The arrays of the store that a batch with the prediction reads."""
        stored = (self.name,) if self.is_stored else ()
        return (*schema.input_names(self.info), *stored)

    def complete(self, arrays: schema.Arrays) -> schema.Arrays:
        """Return arrays with the prediction, computed if they lack it."""
        if self.name in arrays:
            return arrays
        return arrays | {self.name: _roll_out(self.internal, arrays, self.info)}

    def batch(self, arrays: schema.Arrays, steps: int | None = None) -> PushBatch:
        """Return a batch with the prediction, its pusher in camera coordinates.

        Args:
            arrays: of some pushes, by variable name.
            steps: number of steps to keep; None for all.
        """
        slug = self.internal.simulator.stored_as
        arrays = self.complete(arrays)
        batch = to_batch(arrays, self.info, steps=steps, simulated=slug)
        return batch.seen_by(self.internal.camera)


def simulate(
    simulator: SimulatorSpec,
    arrays: schema.Arrays,
    info: schema.StoreInfo,
    pushes: Sequence[str],
) -> Float[np.ndarray, "push time body 6"]:
    """Return the packed motion that a simulator predicts (s-bar).

    Args:
        simulator: predicts.
        arrays: scenes, starts and controls of some pushes, by variable name.
        info: of their store.
        pushes: names of the pushes in messages.

    Raises:
        Diverged: the engine produced NaN or infinity.
        MissingExtra: it needs a package that is not installed.
    """
    motion = _roll_out(InternalEngine(simulator), arrays, info)
    check_finite(simulator.slug, motion, pushes)
    return motion


def _roll_out(
    internal: InternalEngine, arrays: schema.Arrays, info: schema.StoreInfo
) -> Float[np.ndarray, "push time body 6"]:
    moved = _as_measured(internal, to_initial(arrays), to_controls(arrays, info))
    engine, scene = internal.simulator.build(), to_scene(arrays, info)
    return from_trajectory(roll_out(engine, scene, *moved))[0]


def _as_measured(
    internal: InternalEngine, initial: State, controls: Controls
) -> tuple[State, Controls]:
    """Return states and controls with the pusher where the camera would measure it."""
    if not internal.camera:
        return initial, controls
    offset = jnp.array(internal.camera.vector)
    return initial.with_pusher_moved(offset), controls.moved(offset)


def check_finite(
    engine: str, motion: Float[np.ndarray, "push time body 6"], pushes: Sequence[str]
) -> None:
    """Raise `Diverged` if an engine produced NaN or infinity.

    Args:
        engine: its name.
        motion: packed, of each push.
        pushes: name of each push for the message.

    Raises:
        Diverged: the message names the first such push.
    """
    finite = np.isfinite(motion).all((1, 2, 3))
    if not finite.all():
        raise Diverged(
            f"{pushes[int(np.argmin(finite))]}: engine {engine} gave NaN or infinity; "
            "check its masses, radii, frictions and path."
        )
