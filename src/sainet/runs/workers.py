"""Worker processes: a pool with one per core, which ends with its parent."""

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
from multiprocessing.resource_tracker import ensure_running
from typing import Any, final

from sainet.runs.errors import BadSetting, SainetError
from sainet.runs.interrupts import remember_interrupt
from sainet.runs.programs import make_room

# Signal that a failure sends to the workers of its pool. Workers of background jobs
# ignore SIGINT, which a shell sends to foreground jobs.
_FAILURE = getattr(signal, "SIGUSR1", signal.SIGINT)


def core_count() -> int:
    """Return the number of cores available to this process."""
    return len(_cores()) or os.cpu_count() or 1


@contextmanager
def worker_pool(workers: int | None, *, core_each: bool = False) -> Iterator[Executor]:
    """Yield a pool of processes, by default one per core.

    Ctrl-C and any failure here raise `KeyboardInterrupt` in the running jobs, which may
    save their state; no further job starts.

    Args:
        workers: number of processes.
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
        # A terminal signals every process, but `kill` signals only this one.
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

    Spawned, not forked: processes forked after the start of JAX hang.

    Args:
        workers: number of processes.
        core_each: bind each process to a core of its own, if the system supports this.
            Its jobs then run as on a machine with one core, without extra threads.
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
    """Return the cores that processes can be bound to; empty except on Linux."""
    return sorted(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else []


@final
class InterruptibleExecutor(Executor):
    """Executor on a pool of processes; interrupted processes start no further jobs."""

    def __init__(self, pool: ProcessPoolExecutor, begun: "SimpleQueue[int]") -> None:
        """Store the pool and the queue of its process ids."""
        self._pool = pool
        self._begun = begun

    def interrupt(self) -> None:
        """End the running jobs as at Ctrl-C, and start no further jobs."""
        while not self._begun.empty():
            _signal(self._begun.get(), _FAILURE)

    def submit(
        self,
        work: Callable[..., Any],
        /,
        *arguments: Any,  # noqa: ANN401
        **named: Any,  # noqa: ANN401
    ) -> Future[Any]:
        """Return the future of a job."""
        ensure_running()  # multiprocessing's tracker unblocks SIGINT when it starts
        before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:  # a process that starts here inherits the block, until it is ready
            return self._pool.submit(_do, work, *arguments, **named)
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """End the processes."""
        self._pool.shutdown(wait, cancel_futures=cancel_futures)


@dataclass
class _WorkerState:
    """State of this worker when a signal arrives."""

    is_busy: bool = False
    is_interrupted: bool = False


_worker = _WorkerState()  # one per process, like signal handlers


def _signal(process: int, number: int) -> None:
    with suppress(ProcessLookupError):  # the process may have ended
        os.kill(process, number)


def _begin_worker(cores: "SimpleQueue[int]", begun: "SimpleQueue[int]") -> None:
    end_with_parent()
    # A GPU belongs to the process that started this one.
    os.environ["JAX_PLATFORMS"] = "cpu"
    if not cores.empty():  # holds one core per worker, or none
        os.sched_setaffinity(0, {cores.get()})
    # Background jobs of a shell ignore the signal, and so do their workers.
    if signal.getsignal(signal.SIGINT) is not signal.SIG_IGN:
        signal.signal(signal.SIGINT, _interrupt)
    signal.signal(_FAILURE, _interrupt)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
    begun.put(os.getpid())


def _interrupt(number: int, frame: object) -> None:
    """End the running job once: at a second signal it may be saving its state.

    An idle worker stays alive: the pool would treat its end as a failure and kill the
    other workers.
    """
    is_first = not _worker.is_interrupted
    _worker.is_interrupted = True
    if is_first and _worker.is_busy:
        remember_interrupt()
        raise KeyboardInterrupt


def _do(work: Callable[..., Any], *arguments: Any, **named: Any) -> Any:  # noqa: ANN401
    """Return the result of a job, unless this worker was interrupted before."""
    _worker.is_busy = True
    try:
        if _worker.is_interrupted:
            raise KeyboardInterrupt
        return work(*arguments, **named)
    finally:
        make_room()
        _worker.is_busy = False


def each_done(
    executor: Executor | None, work: Callable[..., int], jobs: Sequence[tuple[Any, ...]]
) -> Iterator[int]:
    """Yield the result of each job when it is finished.

    Args:
        executor: runs the jobs; None runs them in this process, one by one.
        work: a module-level function that returns the index of its job.
        jobs: the arguments of each call.

    Raises:
        SainetError: a worker was killed.
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
    except SainetError:
        list(as_completed([each for each in futures if not each.cancel()]))
        raise
    finally:
        for future in futures:
            future.cancel()


def worker_lost() -> SainetError:
    """Return the error for a killed worker, usually the result of too little memory."""
    return SainetError(
        "a worker process was killed, probably because memory ran out; run the same "
        "command with fewer workers or smaller chunks to resume."
    )


def end_with_parent() -> None:
    """End this worker when its parent dies, even by `kill -9`."""
    parent = multiprocessing.parent_process()
    if parent is None:
        return

    def watch() -> None:
        parent.join()
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
