"""Simulated datasets, made chunk by chunk by any number of workers."""

import logging
from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import asdict
from pathlib import Path

from sainet.datasets.config import GenerateConfig
from sainet.datasets.schema import StoreInfo
from sainet.datasets.simulate import simulate_chunk, store_info
from sainet.datasets.store import Store, open_store
from sainet.datasets.writer import (
    HASHES,
    clear_progress,
    create_arrays,
    finish,
    missing_chunks,
    write_chunk,
)
from sainet.engines import make_engine
from sainet.engines.bullet.engine import MOST_DISKS, BulletEngine
from sainet.engines.simulator import simulator_named
from sainet.runs.errors import require
from sainet.runs.folders import open_run
from sainet.runs.workers import each_done
from sainet.worlds.sampling import chunk_generator, draw

_log = logging.getLogger(__name__)


def generate(
    config: GenerateConfig,
    out: Path,
    *,
    executor: Executor | None = None,
    on_pushes: Callable[[int], None] = lambda pushes: None,
) -> Store:
    """Return a dataset of simulated pushes; an interrupted one resumes.

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
        MissingExtra: an engine needs a package that is not installed.
        Diverged: an engine produced NaN or infinity.
    """
    _check_possible(config)
    folder = open_run(
        out, {"command": "generate", **asdict(config)}, finished_by=HASHES
    )
    if folder.is_finished:
        _log.info("%s is finished already", out)
        clear_progress(out)
        return open_store(out)
    info = store_info(config)
    create_arrays(out, info)
    missing = missing_chunks(out, info)
    on_pushes(config.pushes - sum(_length(info, i) for i in missing))
    jobs = [(config, out, index) for index in missing]
    for index in each_done(executor, make_chunk, jobs):
        on_pushes(_length(info, index))
    finish(out, info)
    return open_store(out)


def _check_possible(config: GenerateConfig) -> None:
    """Raise before anything is written: an engine may be missing, or room for disks."""
    engines = [make_engine(config.engine)]
    engines += [simulator_named(name).build().engine for name in config.assumed_engine]
    if any(isinstance(engine, BulletEngine) for engine in engines):
        wanted = f"at most {MOST_DISKS} with the engine bullet"
        require(config.disks <= MOST_DISKS, "disks", wanted, config.disks)
    for index in range(store_info(config).chunks):
        draw(config, chunk_generator(config.seed, index), config.chunk_size)


def make_chunk(config: GenerateConfig, out: Path, index: int) -> int:
    """Simulate and write one chunk (the job of a worker) and return its index."""
    write_chunk(out, store_info(config), index, simulate_chunk(config, index))
    return index


def _length(info: StoreInfo, index: int) -> int:
    part = info.chunk_slice(index)
    return part.stop - part.start
