"""Disks on a table, pushed by the tool of an emulated controller."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from sainet.engines import make_engine
from sainet.engines.base import AbstractEngine
from sainet.robots.wire.limits import CYCLE
from sainet.scenes.controls import PathControls
from sainet.scenes.scene import Scene
from sainet.scenes.state import State

CHUNK = 16  # cycles that are simulated in one call
THICKNESS = 0.013  # m, of the disks: a pusher above it touches nothing
FAR = np.array([10.0, 10.0])  # m


class EmulatedTable:
    """Disks that the planar engine moves, one step for each cycle of the controller."""

    def __init__(self, scene: Scene, state: State) -> None:
        """Place the disks.

        Args:
            scene: its time step is replaced by the controller's cycle.
            state: poses of the disks.
        """
        self.scene = Scene.disks(
            [float(x) for x in scene.mass],
            [float(x) for x in scene.radius],
            table_friction=float(scene.table_friction),
            disk_friction=float(scene.disk_friction),
            pusher_friction=float(scene.pusher_friction),
            pusher_radius=float(scene.pusher_radius),
            time_step=CYCLE,
        )
        self._engine = make_engine("planar")
        self._state = state
        self._path: list[np.ndarray] = []
        self._low: bool | None = None

    def carry(self, tool: Float[np.ndarray, "3"]) -> None:
        """Move the tool (m, in the table frame, z up from the table) for one cycle."""
        low = bool(tool[2] < THICKNESS)
        place = tool[:2] if low else FAR
        if low != self._low:
            # Lowered or lifted: the pusher does not travel through the disks.
            self._flush()
            self._low = low
            put = jnp.asarray(place, self._state.pusher_position.dtype)
            self._state = eqx.tree_at(lambda s: s.pusher_position, self._state, put)
        self._path.append(place)
        if len(self._path) == CHUNK:
            self._flush()

    @property
    def state(self) -> State:
        """The state now."""
        self._flush()
        return self._state

    @property
    def pose(self) -> Float[np.ndarray, "body 3"]:
        """The poses now, m, m, rad."""
        state = self.state
        return np.column_stack([state.position, state.angle])

    def _flush(self) -> None:
        path = np.array(self._path, np.float32)
        self._path = []
        # Two lengths only, so that two programs are compiled.
        parts = [path] if len(path) == CHUNK else [row[None] for row in path]
        for part in parts:
            self._state = advanced(self._engine, self.scene, self._state, part)


@eqx.filter_jit
def advanced(engine: AbstractEngine, scene: Scene, state: State, path) -> State:
    """The state after the pusher went along a path (m), one row for each cycle."""
    start = jnp.concatenate([state.pusher_position[None], path[:-1]])
    controls = PathControls(path, (path - start) / CYCLE)
    return engine.rollout(scene, state, controls).final
