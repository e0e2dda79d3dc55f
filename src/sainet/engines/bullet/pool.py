"""Distribution of pushes over processes, with one PyBullet world in each."""

import multiprocessing
from concurrent.futures import Executor
from concurrent.futures.process import BrokenProcessPool
from functools import lru_cache

import numpy as np

from sainet.engines.bullet.world import Job, Moved, roll_jobs
from sainet.runs.workers import core_count, spawned_pool, worker_lost

_FEW = 8  # pushes: up to here, one process is faster than several
_SHARES = 4  # parts of the work per process, because processes differ in speed


def roll_everywhere(jobs: list[Job]) -> Moved:
    """Return the motion of pushes simulated on all cores, byte-identical to one core.

    In a worker process the pushes run in that process: the other workers use the
    remaining cores.

    Raises:
        SainetError: a process was killed; the next call starts new processes.
    """
    if len(jobs) <= _FEW or multiprocessing.parent_process() is not None:
        return roll_jobs(jobs)
    size = -(-len(jobs) // (_SHARES * core_count()))
    shares = [jobs[start : start + size] for start in range(0, len(jobs), size)]
    try:
        done = list(_pool().map(roll_jobs, shares))
    except KeyboardInterrupt:
        _pool.cache_clear()  # interrupted processes accept no more jobs
        raise
    except BrokenProcessPool:
        _pool.cache_clear()
        raise worker_lost() from None
    return Moved(*(np.concatenate(parts) for parts in zip(*done, strict=True)))


@lru_cache
def _pool() -> Executor:
    return spawned_pool(core_count())
