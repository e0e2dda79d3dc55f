"""How many scenes the planar engine moves by one step in a second, and how many Bullet.

Both on the same pushes, in the same run, on all cores.
"""

from importlib.util import find_spec
from statistics import median
from typing import Any

import jax

from sainet.bench.timing import check_runs, median_seconds
from sainet.datasets.batch import to_controls, to_initial, to_scene
from sainet.datasets.config import GenerateConfig
from sainet.datasets.simulate import simulate_chunk, store_info
from sainet.engines.base import AbstractEngine
from sainet.engines.bullet.engine import BulletEngine
from sainet.engines.devices import over_devices
from sainet.engines.planar.engine import PlanarEngine
from sainet.scenes.controls import Controls
from sainet.scenes.scene import Scene
from sainet.scenes.state import State, Trajectory

BULLET_BATCH = 400  # scenes, the first of the batch: enough for every process
BATCH = 72 * 72  # scenes: every sequence of two pushes of the grid
STEPS = 80  # 48 that move the pusher, 32 that settle: one planned push
_HOLD_STEPS = 32

Pushes = tuple[Scene, State, Controls]


def bench_engines(
    runs: int = 5, *, batch: int = BATCH, steps: int = STEPS
) -> dict[str, Any]:
    """Measure the planar engine on the planner's load, compilation excluded.

    Args:
        runs: measurements to take the median of.
        batch: scenes of two disks, with the distributions of the paper.
        steps: of 1/240 s, at most 80; the pusher moves in the first 48.

    Returns:
        `planar_scene_steps_per_s`, `bullet_scene_steps_per_s` and the ratio of both,
        `bullet_ratio` (None without PyBullet), and the sizes they were measured with.
    """
    check_runs(runs)
    pushes = _pushes(batch, steps)
    measured = [_measure(pushes) for _ in range(runs)]
    return {
        **_figures(measured, steps),
        "batch": batch,
        "steps": steps,
        "devices": jax.device_count(),
        "runs": runs,
    }


def _measure(pushes: Pushes) -> tuple[float, float | None]:
    """Return how many scenes each engine rolls out in a second, one after the other."""
    engine = PlanarEngine()
    time = median_seconds(lambda: over_devices(_rollout, engine, *pushes), 1)
    return _count(pushes) / time, _bullet_rate(pushes)


def _bullet_rate(pushes: Pushes) -> float | None:
    if not find_spec("pybullet"):
        return None
    few, engine = jax.tree.map(lambda x: x[:BULLET_BATCH], pushes), BulletEngine()
    # The call that warms up starts the processes.
    return _count(few) / median_seconds(lambda: engine.rollout(*few), 1)


def _count(pushes: Pushes) -> int:
    return pushes[0].batch_shape[0]


def _figures(
    measured: list[tuple[float, float | None]], steps: int
) -> dict[str, float | None]:
    """Return the medians; of the ratio, over what was measured side by side."""
    ratios = [planar / bullet for planar, bullet in measured if bullet]
    rates = [bullet for _, bullet in measured if bullet]
    return {
        "planar_scene_steps_per_s": steps * median(planar for planar, _ in measured),
        "bullet_scene_steps_per_s": steps * median(rates) if rates else None,
        "bullet_ratio": median(ratios) if ratios else None,
    }


def _rollout(
    engine: AbstractEngine, scene: Scene, initial: State, controls: Controls
) -> Trajectory:
    return engine.rollout(scene, initial, controls)


def _pushes(batch: int, steps: int) -> Pushes:
    config = GenerateConfig(
        pushes=batch, chunk_size=batch, hold_steps=_HOLD_STEPS, noise_level="none"
    )
    info, arrays = store_info(config), simulate_chunk(config, 0)
    controls = to_controls(arrays, info, slice(steps))
    return to_scene(arrays, info), to_initial(arrays), controls
