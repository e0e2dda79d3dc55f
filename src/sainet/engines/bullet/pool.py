"""Pushes spread over processes, one PyBullet world in each."""

import multiprocessing
from concurrent.futures import Executor
from concurrent.futures.process import BrokenProcessPool
from functools import lru_cache

import numpy as np

from sainet.engines.bullet.world import Job, Moved, roll_jobs
from sainet.runs.workers import core_count, spawned_pool, worker_lost

_FEW = 8  # pushes for which asking other processes does not pay
_SHARES = 4  # of the work that each process gets: their speeds differ


def roll_everywhere(jobs: list[Job]) -> Moved:
    """Simulate pushes on all cores; the same bits as one after the other.

    A process that is itself a worker does them alone: its siblings use the cores.

    Raises:
        SainetError: a process was ended from outside; the next call gets new ones.
    """
    if len(jobs) <= _FEW or multiprocessing.parent_process() is not None:
        return roll_jobs(jobs)
    size = -(-len(jobs) // (_SHARES * core_count()))
    shares = [jobs[start : start + size] for start in range(0, len(jobs), size)]
    try:
        done = list(_pool().map(roll_jobs, shares))
    except KeyboardInterrupt:
        _pool.cache_clear()  # an interrupted process takes no more jobs
        raise
    except BrokenProcessPool:
        _pool.cache_clear()
        raise worker_lost() from None
    return Moved(*(np.concatenate(parts) for parts in zip(*done, strict=True)))


@lru_cache
def _pool() -> Executor:
    return spawned_pool(core_count())
