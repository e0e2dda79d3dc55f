"""Where independent pieces of work run: processes here, or workers of Dask elsewhere.

Dask's workers are processes on any machines that share the file system of this one. A
piece writes files atomically and returns little, so a lost worker loses only the piece
that it was working on, which the scheduler gives to another worker.
"""

import logging
import os
import threading
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import CancelledError, Executor, Future, InvalidStateError
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from importlib.util import find_spec
from typing import Any, final

from sainet.runs.errors import BadInput, SainetError, missing_extra, require
from sainet.runs.interrupts import forget_interrupts, remember_interrupt
from sainet.runs.manifest import code_versions, use_cache
from sainet.runs.shards import Shard
from sainet.runs.workers import worker_pool

_ANSWERS_IN = 10  # s that a scheduler has to answer
_LOOK_AGAIN = 0.5  # s between looks at the connection
_CLOSES_IN = 2  # s


@dataclass(frozen=True)
class Machines:
    """Where independent pieces run, and which of them."""

    scheduler: str | None = None
    """Address of a Dask scheduler, for example tcp://node1:8786, whose workers do the
    work instead of processes on this machine (extra cluster). Default: none."""
    shard: str | None = None
    """Share of the independent pieces to do, for example 3/8 for the third of eight.
    Shards may run at the same time, on any machines that share the folder; the same
    command without a shard makes the missing pieces and finishes. Default: all
    pieces."""

    @property
    def share(self) -> Shard | None:
        """The shard, if one is given.

        Raises:
            BadSetting: the text names no shard.
        """
        return None if self.shard is None else Shard.parse(self.shard)

    def refuse_with_shard(self, **others: object) -> None:
        """Raise `BadSetting` for an option that a shard would ignore."""
        for name, value in others.items():
            is_fine = self.shard is None or not value
            require(is_fine, name, "left out with a shard", value)

    @contextmanager
    def executor(
        self, workers: int | None = None, *, core_each: bool = False
    ) -> Iterator[Executor]:
        """Yield the executor of independent pieces; at its end none is left running.

        Args:
            workers: number of processes on this machine; None: one per core.
            core_each: see `spawned_pool`; a Dask worker has the cores that it was
                given.

        Raises:
            BadInput: there is no such scheduler, or a worker of it cannot be used.
            MissingExtra: the extra `cluster` is not installed.
            SainetError: the connection to the scheduler was lost.
        """
        if self.scheduler is None:
            with worker_pool(workers, core_each=core_each) as pool:
                yield pool
            return
        client = _connected(self.scheduler)
        executor = ClusterExecutor(client, self.scheduler)
        try:
            yield executor
        finally:
            executor.shutdown(cancel_futures=True)


def _connected(address: str) -> Any:  # noqa: ANN401
    """Return a client of a scheduler, all of whose workers can do our work."""
    if find_spec("distributed") is None:
        needs = "A Dask scheduler needs the package distributed"
        raise missing_extra(needs, "cluster")
    from distributed import Client

    # Dask would report a lost connection in many lines; our error is one.
    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    try:
        client = Client(address, timeout=_ANSWERS_IN, set_as_default=False)
    except (OSError, ValueError, TypeError, ImportError) as error:
        raise BadInput(
            f"`scheduler` is {address}: no Dask scheduler of the same version answers "
            f"there ({_first_line(error)}); start one with 'dask scheduler', or give "
            "its address."
        ) from None
    try:
        prepare = partial(_prepare, client.id, dict(code_versions()))
        client.register_worker_callbacks(prepare)
    except Exception as error:
        client.close(_CLOSES_IN)
        if isinstance(error, SainetError):
            raise
        raise BadInput(
            f"`scheduler` is {address}: its workers cannot run this version of sainet "
            f"({_first_line(error)}); start scheduler and workers in the same "
            "environment as this command."
        ) from None
    return client


def _prepare(client: str, wanted: Mapping[str, str | None], dask_worker: Any) -> None:  # noqa: ANN401
    """Prepare a worker, before it imports JAX, or refuse it: if late, in its jobs."""
    use_cache()
    try:
        _check_worker(wanted, dask_worker)
    except BadInput as error:
        _refused[client] = error
        raise


def _check_worker(wanted: Mapping[str, str | None], dask_worker: Any) -> None:  # noqa: ANN401
    name = f"Dask worker {dask_worker.address}"
    if dask_worker.state.nthreads != 1:
        raise BadInput(
            f"{name} has {dask_worker.state.nthreads} threads; start workers with "
            "'nthreads' 1, as many as there are cores."
        )
    found = dict(code_versions())
    for package, version in wanted.items():
        if found.get(package) != version:
            raise BadInput(
                f"{name}: {package} is {found.get(package)} there and {version} here; "
                "use the same environment everywhere."
            )


@dataclass
class _Job:
    """What this worker works on."""

    client: str | None = None


_job = _Job()  # one per process: a worker has one thread for jobs
_refused: dict[str, BadInput] = {}  # why clients cannot use this worker


def _end_job(client: str) -> None:
    """End the job of a client at its next step, if this worker works on one."""
    if _job.client == client:
        remember_interrupt()


def _work_in(folder: str, client: str, work: Callable[[], Any]) -> Any:  # noqa: ANN401
    """Return the result of a job of a worker, which works in the folder of the client.

    Relative paths then mean the same files.
    """
    if client in _refused:
        raise _refused[client]
    forget_interrupts()
    _job.client = client
    try:
        _enter(folder)
        return work()
    except KeyboardInterrupt:  # would end the worker
        raise SainetError("the command was interrupted; it resumes.") from None
    finally:
        _job.client = None


def _enter(folder: str) -> None:
    try:
        os.chdir(folder)
    except OSError as error:
        raise BadInput(
            f"{folder}: {error.strerror} on a Dask worker; workers need the file "
            "system of this command."
        ) from None


@final
class ClusterExecutor(Executor):
    """Executor on the workers of a scheduler; errors are those of processes.

    A piece whose worker dies is given to another worker. When the connection to the
    scheduler is lost, every unfinished piece fails with one error.
    """

    def __init__(self, client: Any, address: str) -> None:  # noqa: ANN401
        """Take over a connected client."""
        self._client = client
        self._address = address
        self._inner = client.get_executor(pure=False)
        self._unfinished: set[Future[Any]] = set()
        self._has_ended = threading.Event()
        threading.Thread(target=self._watch, daemon=True).start()

    def submit(
        self,
        work: Callable[..., Any],
        /,
        *arguments: Any,  # noqa: ANN401
        **named: Any,  # noqa: ANN401
    ) -> Future[Any]:
        """Return the future of a job.

        Raises:
            SainetError: the connection to the scheduler was lost.
        """
        if not self._is_connected:
            raise self._lost()
        # Opaque: Dask looks for its own futures in arguments.
        job = partial(work, *arguments, **named)
        found: Future[Any] = Future()
        inner = self._inner.submit(_work_in, os.getcwd(), self._client.id, job)
        self._unfinished.add(found)
        inner.add_done_callback(lambda done: self._settle(found, _error_of(done), done))
        found.add_done_callback(partial(self._forget, inner))
        return found

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """End the connection; waiting jobs never begin, long ones end as at Ctrl-C."""
        self._has_ended.set()
        left = list(self._unfinished) if cancel_futures else []
        with suppress(Exception):  # of a connection that is lost
            for future in left:
                future.cancel()
            if self._is_connected:  # of some jobs, whoever waits for them has given up
                self._client.run(_end_job, self._client.id, on_error="ignore")
            self._client.close(_CLOSES_IN)

    @property
    def _is_connected(self) -> bool:
        return self._client.status == "running"

    def _lost(self) -> SainetError:
        return SainetError(
            f"the connection to the Dask scheduler at {self._address} was lost; start "
            "a scheduler again, then run the same command to resume."
        )

    def _watch(self) -> None:
        """Fail every unfinished job once the connection is lost."""
        while not self._has_ended.wait(_LOOK_AGAIN):
            if not self._is_connected:
                for future in list(self._unfinished):
                    self._settle(future, self._lost())

    def _settle(
        self,
        future: Future[Any],
        error: BaseException | None,
        done: "Future[Any] | None" = None,
    ) -> None:
        if isinstance(error, CancelledError):  # by the client, which lost its scheduler
            error = self._lost()
        with suppress(InvalidStateError):  # cancelled, or failed already
            if error is not None:
                future.set_exception(error)
            elif done is not None:
                future.set_result(done.result())

    def _forget(self, inner: Future[Any], future: Future[Any]) -> None:
        self._unfinished.discard(future)
        if future.cancelled() and self._is_connected:
            inner.cancel()


def _error_of(done: Future[Any]) -> BaseException | None:
    """Return the error of a job, if any, as of a job of a process."""
    if done.cancelled():
        return CancelledError()
    from distributed import KilledWorker

    error = done.exception()
    if not isinstance(error, KilledWorker):
        return error
    return SainetError(
        "several Dask workers died at the same piece of work, probably because memory "
        "ran out; run the same command with fewer workers on each machine to resume."
    )


def _first_line(error: BaseException) -> str:
    return (str(error).strip().splitlines() or [type(error).__name__])[0]
