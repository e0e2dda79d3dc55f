"""How many scenes the planar engine moves by one step in a second."""

from typing import Any

import jax

from sainet.bench.timing import check_runs, median_seconds
from sainet.datasets.batch import to_controls, to_initial, to_scene
from sainet.datasets.config import GenerateConfig
from sainet.datasets.simulate import simulate_chunk, store_info
from sainet.devices import over_devices
from sainet.engines.base import AbstractEngine
from sainet.engines.planar.engine import PlanarEngine
from sainet.pushes import Controls
from sainet.scene import Scene, State, Trajectory

BATCH = 72 * 72  # scenes: every sequence of two pushes of the grid
STEPS = 80  # 48 that move the pusher, 32 that settle: one planned push
_HOLD_STEPS = 32


def bench_engines(
    runs: int = 5, *, batch: int = BATCH, steps: int = STEPS
) -> dict[str, Any]:
    """Measure the planar engine on the planner's load, compilation excluded.

    Args:
        runs: measurements to take the median of.
        batch: scenes of two disks, with the distributions of the paper.
        steps: of 1/240 s, at most 80; the pusher moves in the first 48.

    Returns:
        `planar_scene_steps_per_s`, and the sizes that it was measured with.
    """
    check_runs(runs)
    scene, initial, controls = _pushes(batch, steps)
    engine = PlanarEngine()
    time = median_seconds(
        lambda: over_devices(_rollout, engine, scene, initial, controls), runs
    )
    return {
        "planar_scene_steps_per_s": batch * steps / time,
        "batch": batch,
        "steps": steps,
        "devices": jax.device_count(),
        "runs": runs,
    }


def _rollout(
    engine: AbstractEngine, scene: Scene, initial: State, controls: Controls
) -> Trajectory:
    return engine.rollout(scene, initial, controls)


def _pushes(batch: int, steps: int) -> tuple[Scene, State, Controls]:
    config = GenerateConfig(
        pushes=batch, chunk_size=batch, hold_steps=_HOLD_STEPS, noise_level="none"
    )
    info, arrays = store_info(config), simulate_chunk(config, 0)
    controls = to_controls(arrays, info, slice(steps))
    return to_scene(arrays, info), to_initial(arrays), controls
