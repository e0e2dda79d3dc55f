"""Set JAX up before the first array is made, and workers before the first chunk."""

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


def use_devices(count: int | None = None) -> None:
    """Make JAX see each core as a device of its own; a GPU takes precedence.

    Raises:
        BadInput: a count below one.
    """
    import jax

    if count is not None and count < 1:
        raise BadInput(f"--devices is {count}; it must be at least 1.")
    jax.config.update("jax_num_cpu_devices", count or core_count())


@contextmanager
def worker_pool(workers: int | None) -> Iterator[Executor]:
    """Give a pool of processes, as many as there are cores by default.

    Spawned, not forked: a process that is forked after JAX has started hangs.

    Raises:
        BadInput: fewer than one worker.
    """
    if workers is not None and workers < 1:
        raise BadInput(f"--workers is {workers}; it must be at least 1.")
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(
        workers or core_count(), mp_context=context, initializer=end_with_parent
    ) as pool:
        yield pool


def end_with_parent() -> None:
    """End this worker when its parent dies, even of `kill -9`: nobody else would."""
    parent = multiprocessing.parent_process()
    if parent is None:
        return

    def watch() -> None:
        parent.join()
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
