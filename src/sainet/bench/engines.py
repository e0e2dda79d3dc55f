"""Scene steps per second of the planar engine and of Bullet.

Both simulate the same pushes, in the same run, on all cores.
"""

from importlib.util import find_spec
from statistics import median

import jax

from sainet.bench import Figures
from sainet.bench.timing import check_runs, median_seconds
from sainet.datasets.batch import to_batch
from sainet.datasets.config import GenerateConfig
from sainet.datasets.generate import simulate_chunk, store_info
from sainet.engines.base import AbstractEngine
from sainet.engines.bullet.engine import BulletEngine
from sainet.engines.devices import over_devices
from sainet.engines.planar.engine import PlanarEngine
from sainet.scenes.controls import Controls
from sainet.scenes.scene import Scene
from sainet.scenes.state import State, Trajectory

BULLET_BATCH = 400  # scenes at the start of the batch: enough for every process
BATCH = 72 * 72  # scenes: every sequence of two candidate pushes
STEPS = 80  # of a planned push: 48 of motion and 32 to settle
_HOLD_STEPS = 32

Pushes = tuple[Scene, State, Controls]


def bench_engines(runs: int = 5, *, batch: int = BATCH, steps: int = STEPS) -> Figures:
    """Return the speed of both engines under the planner's load, without compilation.

    Args:
        runs: number of measurements, for the median.
        batch: number of scenes with two disks, from the paper's distributions.
        steps: steps of 1/240 s, at most 80; the pusher moves in the first 48.

    Returns:
        `planar_scene_steps_per_s`, `bullet_scene_steps_per_s` and their ratio
        `bullet_ratio` (None without PyBullet), and the sizes of the measurement.
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
    """Return the scenes per second of each engine, measured one after the other."""
    engine = PlanarEngine()
    time = median_seconds(lambda: over_devices(_rollout, engine, *pushes), 1)
    return _count(pushes) / time, _bullet_rate(pushes)


def _bullet_rate(pushes: Pushes) -> float | None:
    if not find_spec("pybullet"):
        return None
    few, engine = jax.tree.map(lambda x: x[:BULLET_BATCH], pushes), BulletEngine()
    # The warm-up call starts the processes.
    return _count(few) / median_seconds(lambda: engine.rollout(*few), 1)


def _count(pushes: Pushes) -> int:
    return pushes[0].batch_shape[0]


def _figures(measured: list[tuple[float, float | None]], steps: int) -> Figures:
    """Return the medians; the ratio is the median of the ratios of each measurement."""
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
    made = to_batch(simulate_chunk(config, 0), store_info(config), steps=steps)
    return made.scene, made.initial, made.controls
