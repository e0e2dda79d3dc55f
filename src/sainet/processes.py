"""Processes of this machine: how many pay, and workers that end with their parent."""

import multiprocessing
import os
import threading
from collections.abc import Iterator
from concurrent.futures import Executor, ProcessPoolExecutor
from contextlib import contextmanager

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


def end_with_parent() -> None:
    """End this worker when its parent dies, even of `kill -9`: nobody else would."""
    parent = multiprocessing.parent_process()
    if parent is None:
        return

    def watch() -> None:
        parent.join()
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
