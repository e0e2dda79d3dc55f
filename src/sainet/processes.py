"""Processes of this machine: how many pay, and workers that end with their parent."""

import multiprocessing
import os
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, ProcessPoolExecutor, as_completed
from contextlib import contextmanager
from typing import Any

from sainet.errors import BadInput


def core_count() -> int:
    """Return how many cores this process may use."""
    return len(os.sched_getaffinity(0))


@contextmanager
def worker_pool(workers: int | None) -> Iterator[Executor]:
    """Give a pool of processes, as many as there are cores by default.

    Raises:
        BadInput: fewer than one worker.
    """
    if workers is not None and workers < 1:
        raise BadInput(f"--workers is {workers}; it must be at least 1.")
    with spawned_pool(workers or core_count()) as pool:
        yield pool


def spawned_pool(workers: int) -> ProcessPoolExecutor:
    """Return a pool of processes that end with this one.

    Spawned, not forked: a process that is forked after JAX has started hangs.
    """
    context = multiprocessing.get_context("spawn")
    return ProcessPoolExecutor(workers, mp_context=context, initializer=end_with_parent)


def each_done(
    executor: Executor | None, work: Callable[..., int], jobs: Sequence[tuple[Any, ...]]
) -> Iterator[int]:
    """Yield what each job returns, when it is done.

    Args:
        executor: does the jobs; None does them here, one by one.
        work: a function of a module; it returns the index of its job.
        jobs: the arguments of each call.
    """
    if executor is None:
        for job in jobs:
            yield work(*job)
        return
    futures = [executor.submit(work, *job) for job in jobs]
    try:
        for future in as_completed(futures):
            yield future.result()
    finally:
        for future in futures:
            future.cancel()


def end_with_parent() -> None:
    """End this worker when its parent dies, even of `kill -9`: nobody else would."""
    parent = multiprocessing.parent_process()
    if parent is None:
        return

    def watch() -> None:
        parent.join()
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
