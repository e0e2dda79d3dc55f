"""Disks and a tracker in the process of an emulated controller; imports little."""

from collections.abc import Callable

import jax.numpy as jnp
import numpy as np

from robots.wire.emulated_table import EmulatedTable
from robots.wire.emulated_tracker import EmulatedTracker
from sainet.robots.wire.cell import Cell
from sainet.scenes.state import at_rest

TABLE = np.array([[-0.05, 0.02, 2.0], [0.055, 0.02, -1.0]])
EVERY = 4  # cycles, for each frame


def disks_beneath(
    cell: Cell, names: list[str], start: np.ndarray
) -> Callable[[np.ndarray], None]:
    """Disks and a tracker, in the process of the controller."""
    place, angle = jnp.float32(TABLE[:, :2]), jnp.float32(TABLE[:, 2])
    table = EmulatedTable(cell.scene, at_rest(place, angle, jnp.zeros(2)))
    calibration, height = cell.calibration, cell.disks[0].height_mm / 1000
    to_tracker = calibration.tracker_to_table.inverse
    port = cell.tracker.port
    tracker = EmulatedTracker(names, lambda: table.pose, to_tracker, height, port)
    cycles = iter(range(10**9))

    def carry(tool: np.ndarray) -> None:
        table.carry(calibration.table_to_robot.inverse.moved(tool))
        if next(cycles) % EVERY == 0:
            tracker.tick()

    for height in (0.0, 0.1):  # compiles
        table.carry(np.array([-0.2, 0.2, height]))
        assert np.isfinite(table.pose).all()
    return carry
