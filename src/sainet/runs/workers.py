"""Processes of this machine: how many pay, and workers that end with their parent."""

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, Future, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from itertools import cycle, islice
from multiprocessing.queues import SimpleQueue
from typing import Any, final

from sainet.runs.errors import BadSetting, SainetError
from sainet.runs.interrupts import remember_interrupt

# What a failure sends to the workers of its own pool. Those of a background job ignore
# SIGINT, which a shell means for what stands in the foreground.
_FAILURE = getattr(signal, "SIGUSR1", signal.SIGINT)


def core_count() -> int:
    """Return how many cores this process may use."""
    if hasattr(os, "sched_getaffinity"):  # on Linux
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


@contextmanager
def worker_pool(workers: int | None, *, core_each: bool = False) -> Iterator[Executor]:
    """Give a pool of processes, as many as there are cores by default.

    Ctrl-C, or any failure here, reaches the jobs under way as `KeyboardInterrupt`, so
    that they may keep what they have; none begins after it.

    Args:
        workers: how many processes.
        core_each: see `spawned_pool`.

    Raises:
        BadSetting: fewer than one worker.
    """
    if workers is not None and workers < 1:
        raise BadSetting("workers", workers, "at least 1")
    pool = spawned_pool(workers or core_count(), core_each=core_each)
    try:
        yield pool
    except KeyboardInterrupt:
        # A terminal tells every process; whoever signals this one alone does not.
        for process in multiprocessing.active_children():
            if process.pid is not None:
                _signal(process.pid, signal.SIGINT)
        raise
    except BaseException:
        pool.interrupt()
        raise
    finally:
        pool.shutdown(cancel_futures=True)


def spawned_pool(workers: int, *, core_each: bool = False) -> "InterruptibleExecutor":
    """Return a pool of processes that end with this one, quietly at Ctrl-C.

    Spawned, not forked: a process that is forked after JAX has started hangs.

    Args:
        workers: how many processes.
        core_each: keep each to a core of its own, where the system can. To what runs
            there this is a machine of one core, which spares it threads.
    """
    context = multiprocessing.get_context("spawn")
    cores = context.SimpleQueue()
    for core in islice(cycle(_cores()), workers if core_each else 0):
        cores.put(core)
    begun = context.SimpleQueue()
    pool = ProcessPoolExecutor(
        workers, context, initializer=_begin_worker, initargs=(cores, begun)
    )
    return InterruptibleExecutor(pool, begun)


def _cores() -> list[int]:
    """Return the cores that processes can be kept to; none where they cannot."""
    return sorted(os.sched_getaffinity(0)) if hasattr(os, "sched_setaffinity") else []


@final
class InterruptibleExecutor(Executor):
    """Does jobs in a pool of processes; none begins in an interrupted one."""

    def __init__(self, pool: ProcessPoolExecutor, begun: "SimpleQueue[int]") -> None:
        """Have the pool, and what tells the numbers of its processes."""
        self._pool = pool
        self._begun = begun

    def interrupt(self) -> None:
        """Have the jobs under way end as at Ctrl-C, and no more begin."""
        while not self._begun.empty():
            _signal(self._begun.get(), _FAILURE)

    def submit(
        self,
        work: Callable[..., Any],
        /,
        *arguments: Any,  # noqa: ANN401
        **named: Any,  # noqa: ANN401
    ) -> Future[Any]:
        """Have a job done."""
        return self._pool.submit(_do, work, *arguments, **named)

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """End the processes."""
        self._pool.shutdown(wait, cancel_futures=cancel_futures)


@dataclass
class _WorkerState:
    """What a signal finds this worker at."""

    is_busy: bool = False
    is_interrupted: bool = False


_worker = _WorkerState()  # one a process, as signal handlers are


def _signal(process: int, number: int) -> None:
    with suppress(ProcessLookupError):  # it may have ended meanwhile
        os.kill(process, number)


def _begin_worker(cores: "SimpleQueue[int]", begun: "SimpleQueue[int]") -> None:
    end_with_parent()
    if not cores.empty():  # one waits for each worker, or none for any
        os.sched_setaffinity(0, {cores.get()})
    # A shell has its background jobs ignore the signal; so do their workers.
    if signal.getsignal(signal.SIGINT) is not signal.SIG_IGN:
        signal.signal(signal.SIGINT, _interrupt)
    signal.signal(_FAILURE, _interrupt)
    begun.put(os.getpid())


def _interrupt(number: int, frame: object) -> None:
    """End the job under way, once: a second signal finds it keeping what it has.

    An idle worker stays: to the pool its end would be a failure, for which the pool
    kills the others.
    """
    is_first = not _worker.is_interrupted
    _worker.is_interrupted = True
    if is_first and _worker.is_busy:
        remember_interrupt()
        raise KeyboardInterrupt


def _do(work: Callable[..., Any], *arguments: Any, **named: Any) -> Any:  # noqa: ANN401
    """Do a job, unless this worker was interrupted: more may be waiting for it."""
    _worker.is_busy = True
    try:
        if _worker.is_interrupted:
            raise KeyboardInterrupt
        return work(*arguments, **named)
    finally:
        _worker.is_busy = False


def each_done(
    executor: Executor | None, work: Callable[..., int], jobs: Sequence[tuple[Any, ...]]
) -> Iterator[int]:
    """Yield what each job returns, when it is done.

    Args:
        executor: does the jobs; None does them here, one by one.
        work: a function of a module; it returns the index of its job.
        jobs: the arguments of each call.

    Raises:
        SainetError: a worker was ended from outside.
    """
    if executor is None:
        for job in jobs:
            yield work(*job)
        return
    futures = []
    try:
        futures += [executor.submit(work, *job) for job in jobs]
        for future in as_completed(futures):
            yield future.result()
    except BrokenProcessPool:
        raise worker_lost() from None
    finally:
        for future in futures:
            future.cancel()


def worker_lost() -> SainetError:
    """Say that a worker of a pool was ended, most often by a system out of memory."""
    return SainetError(
        "a worker process was ended, probably for want of memory; the same command "
        "goes on from here: give it fewer workers or smaller chunks."
    )


def end_with_parent() -> None:
    """End this worker when its parent dies, even of `kill -9`: nobody else would."""
    parent = multiprocessing.parent_process()
    if parent is None:
        return

    def watch() -> None:
        parent.join()
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
