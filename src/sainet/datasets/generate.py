"""Simulated datasets, made chunk by chunk by any number of workers."""

import shutil
from collections.abc import Callable, Mapping
from concurrent.futures import Executor
from dataclasses import asdict
from functools import partial
from pathlib import Path

import numpy as np

from sainet.datasets.batch import check_finite, from_trajectory
from sainet.datasets.check import out_of_range
from sainet.datasets.config import GenerateConfig
from sainet.datasets.schema import Arrays, StoreInfo, simulated_name
from sainet.datasets.store import Store
from sainet.datasets.writer import MakeChunk, write_once, write_share
from sainet.engines import make_engine
from sainet.engines.base import roll_out
from sainet.engines.simulator import simulator_named
from sainet.runs.errors import BadScene, Diverged, require
from sainet.runs.shards import Shard
from sainet.scenes.controls import Controls
from sainet.scenes.quantities import MOST_STEPS, PROPERTIES
from sainet.scenes.scene import TIME_STEP, Scene
from sainet.scenes.state import State, pack_motion
from sainet.worlds.config import SetupName, bounds
from sainet.worlds.noise import at_level
from sainet.worlds.sampling import chunk_generator, draw
from sainet.worlds.setups import SETUPS
from sainet.worlds.world import SimulatedWorld

_SLOWER: Mapping[SetupName, str] = {
    "robot": "reduce `speed_mm_s` or `hold_steps`",
    "direct-force": "reduce `force_n` or `force_steps`, or increase `damping_n_s_m`",
}


def generate(
    config: GenerateConfig,
    out: Path,
    *,
    executor: Executor | None = None,
    on_pushes: Callable[[int], None] = lambda pushes: None,
) -> Store:
    """Return a dataset of simulated pushes; an interrupted one resumes.

    A folder that is made here is removed where the pushes turn out to be impossible.

    Equal settings give byte-identical datasets, whatever the interruptions and the
    number of workers.

    Args:
        config: what to simulate.
        out: the run folder.
        executor: computes the chunks; None computes them in this process, one by one.
        on_pushes: called with the number of newly finished pushes.

    Raises:
        RunConflict: the folder belongs to another run.
        BadInput: the disk is full, a scene has no room for its disks, or an engine
            cannot have as many.
        BadScene: something moves too far or too fast.
        MissingExtra: an engine needs a package that is not installed.
        Diverged: an engine produced NaN or infinity.
    """
    is_new, parts = not out.exists(), _parts(config)
    try:
        return write_once(out, *parts, executor=executor, on_pushes=on_pushes)
    except (BadScene, Diverged):  # as it would be with equal settings again
        if is_new:
            shutil.rmtree(out, ignore_errors=True)
        raise


def generate_share(
    config: GenerateConfig,
    out: Path,
    shard: Shard,
    *,
    executor: Executor | None = None,
    on_pushes: Callable[[int], None] = lambda pushes: None,
) -> int:
    """Simulate the chunks of a shard, and return the number of their pushes.

    `generate` with equal settings finishes the dataset, whose bytes are those that it
    would have without shards.

    Args:
        config: what to simulate.
        out: the run folder that all shards share.
        shard: whose chunks are simulated here.
        executor: as of `generate`.
        on_pushes: as of `generate`.

    Raises:
        SainetError: whatever `generate` raises.
        RunConflict: the folder has shards of other settings or versions.
    """
    parts = _parts(config)
    return write_share(out, *parts, shard=shard, executor=executor, on_pushes=on_pushes)


def _parts(config: GenerateConfig) -> tuple[Mapping[str, object], StoreInfo, MakeChunk]:
    """Return the settings, the form and the chunks of a dataset that is possible."""
    _check_possible(config)
    settings = {"command": "generate", **asdict(config)}
    return settings, store_info(config), partial(simulate_chunk, config)


def _check_possible(config: GenerateConfig) -> None:
    """Raise before anything is written: an engine may be missing, or room for disks."""
    engines = [make_engine(config.engine)]
    engines += [simulator_named(name).build() for name in config.assumed_engine]
    most = min(engine.most_disks for engine in engines)
    wanted = f"at most {most} with these engines"
    require(config.disks <= most, "disks", wanted, config.disks)
    info = store_info(config)
    wanted = f"shorter, `speed_mm_s` higher or `hold_steps` fewer: {info.steps} steps "
    wanted += f"exceed {MOST_STEPS}"
    require(info.steps <= MOST_STEPS, "stroke_mm", wanted, max(config.stroke_mm))
    for index in range(info.chunks):
        draw(config, chunk_generator(config.seed, index), config.chunk_size)


def store_info(config: GenerateConfig) -> StoreInfo:
    """Return the properties of the whole dataset."""
    stroke = np.array(bounds(config.stroke_mm)[1] / 1000)
    speed = np.array(bounds(config.speed_mm_s)[0] / 1000)
    longest = SETUPS[config.setup](config).steps(stroke, speed)
    specs = [simulator_named(name) for name in config.assumed_engine]
    return StoreInfo(
        kind=config.setup,
        pushes=config.pushes,
        bodies=config.disks,
        steps=int(longest),
        chunk_size=config.chunk_size,
        time_step=TIME_STEP,
        engine=config.engine,
        assumed_engines=tuple(spec.stored_as for spec in specs),
        has_measurements=True,
        seed=config.seed,
        damping=config.damping_n_s_m,
    )


def simulate_chunk(config: GenerateConfig, index: int) -> Arrays:
    """Return every array of one chunk of the dataset.

    The chunk depends only on the settings and its index, not on the process.

    Raises:
        Diverged: an engine predicted NaN or infinity.
        BadScene: a value is out of the range of stored values.
    """
    info = store_info(config)
    part = info.chunk_slice(index)
    world = SimulatedWorld(
        make_engine(config.engine),
        SETUPS[config.setup](config),
        at_level(config.noise, config.noise_level),
        chunk_generator(config.seed, index),
    )
    # Always a whole chunk, so that the last chunk needs no compilation of its own.
    draws = draw(config, world.rng, config.chunk_size)
    scene, push = draws.scene(), draws.push()
    initial, controls = world.setup.command(scene, draws.state(), push, info.steps)
    rough = world.roughen(scene)
    truth, pusher = from_trajectory(world.execute(rough, initial, controls))
    predicted = {"truth": truth}
    engines = {"truth": config.engine}
    for name in config.assumed_engine:
        simulator = simulator_named(name)
        array = simulated_name(simulator.stored_as)
        motion = roll_out(simulator.build(), scene, initial, controls)
        predicted[array], engines[array] = from_trajectory(motion)[0], name
    arrays = {
        **_scene_arrays(scene, initial, controls),
        **predicted,
        "steps": world.setup.steps(draws.stroke, draws.speed),
        "group": np.zeros(config.chunk_size),
        "truth_pusher": pusher,
        "pose_observed": np.ones(truth.shape[:2]),
        "rate_observed": np.ones(truth.shape[:2]),
        "measured": world.capture(truth[..., :3]),
    }
    arrays = {name: value[: part.stop - part.start] for name, value in arrays.items()}
    for array, engine in engines.items():
        check_finite(engine, arrays[array], info.push_names(part))
    rows = np.arange(part.start, part.stop)
    for name, reason in out_of_range(info, rows, arrays, arrays.__getitem__):
        raise BadScene(f"{name}: {reason}; {_SLOWER[config.setup]}.")
    return arrays


def _scene_arrays(scene: Scene, initial: State, controls: Controls) -> Arrays:
    arrays = {name: getattr(scene, name) for name in PROPERTIES}
    arrays |= {"initial": pack_motion(initial), **controls.arrays()}
    arrays |= {"initial_pusher": initial.pusher_position}
    return {name: np.asarray(value) for name, value in arrays.items()}
