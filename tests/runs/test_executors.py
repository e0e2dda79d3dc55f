"""Where pieces run: processes here, or the workers of a Dask scheduler."""

import os
import time
from concurrent.futures import CancelledError, Future
from importlib.util import find_spec

import pytest

from runs.dask_cluster import Cluster
from sainet.runs import executors
from sainet.runs.errors import BadInput, BadSetting, MissingExtra, SainetError
from sainet.runs.executors import Machines
from sainet.runs.interrupts import raise_if_interrupted
from sainet.runs.shards import Shard
from support import require


@pytest.fixture
def dask():
    require(find_spec("distributed"), "distributed is not installed")


def test_processes_of_this_machine_are_the_default():
    with Machines().executor(1) as executor:
        assert executor.submit(os.getpid).result() != os.getpid()
    assert Machines().share is None
    assert Machines(shard="2/3").share == Shard(2, 3)


def test_a_missing_extra_is_named(monkeypatch):
    monkeypatch.setattr(executors, "find_spec", lambda name: None)
    with (
        pytest.raises(MissingExtra, match=r"pip install 'sainet\[cluster\]'"),
        Machines("tcp://127.0.0.1:1").executor(),
    ):
        pass


@pytest.mark.usefixtures("dask")
@pytest.mark.parametrize("address", ["tcp://127.0.0.1:1", "nonsense://x", "", "a:b"])
def test_an_address_without_a_scheduler_is_named(address, monkeypatch):
    monkeypatch.setattr(executors, "_ANSWERS_IN", 0.2)
    with (
        pytest.raises(BadInput, match=f"`scheduler` is {address}: .*'dask scheduler'"),
        Machines(address).executor(),
    ):
        pass


@pytest.mark.usefixtures("dask")
def test_work_on_a_scheduler_until_it_dies(tmp_path, monkeypatch):
    """One test, because a cluster takes seconds to start."""
    with Cluster(tmp_path) as cluster:
        cluster.add_worker()
        monkeypatch.chdir(tmp_path)
        with Machines(cluster.address).executor() as executor:
            assert executor.submit(os.getcwd).result() == str(tmp_path)
            with pytest.raises(BadSetting, match="`shard` is 5/4"):
                executor.submit(Shard.parse, "5/4").result()
            cancelled = executor.submit(time.sleep, 60)
            assert cancelled.cancel()
        monkeypatch.setattr(executors, "code_versions", lambda: {"sainet": "0.0.1"})
        with (
            pytest.raises(BadInput, match=r"worker .*: sainet is .* there and 0\.0\.1"),
            Machines(cluster.address).executor(),
        ):
            pass
        monkeypatch.undo()
        with Machines(cluster.address).executor() as executor:
            future = executor.submit(time.sleep, 60)
            cluster.scheduler.kill()
            with pytest.raises(SainetError, match="connection to the Dask scheduler"):
                future.result(timeout=30)
            with pytest.raises(SainetError, match="same command to resume"):
                executor.submit(time.sleep, 0)


@pytest.mark.usefixtures("dask")
def test_errors_of_workers_are_those_of_processes():
    from distributed import KilledWorker

    future = Future()
    future.set_exception(KilledWorker("key", None, 3))
    assert "several Dask workers died" in str(executors._error_of(future))
    future = Future()
    future.cancel()
    assert isinstance(executors._error_of(future), CancelledError)
    future = Future()
    future.set_result(3)
    assert executors._error_of(future) is None


def test_a_worker_with_several_threads_is_refused():
    class State:
        nthreads = 2

    class Worker:
        address = "tcp://1.2.3.4:5"
        state = State

    with pytest.raises(BadInput, match="tcp://1.2.3.4:5 has 2 threads"):
        executors._prepare("late", {}, Worker)
    # Dask only logs the refusal of a worker that comes later.
    with pytest.raises(BadInput, match="tcp://1.2.3.4:5 has 2 threads"):
        executors._work_in(os.getcwd(), "late", os.getcwd)
    assert executors._work_in(os.getcwd(), "other", os.getcwd) == os.getcwd()


def test_a_folder_that_a_worker_lacks_is_named(tmp_path):
    with pytest.raises(BadInput, match="missing: .* need the file system"):
        executors._work_in(str(tmp_path / "missing"), "client", os.getcwd)


def test_an_interrupted_job_does_not_end_its_worker():
    def work():
        executors._end_job("other")
        raise_if_interrupted()
        executors._end_job("client")
        raise_if_interrupted()
        raise AssertionError

    with pytest.raises(SainetError, match="interrupted; it resumes"):
        executors._work_in(os.getcwd(), "client", work)
    executors._work_in(os.getcwd(), "client", raise_if_interrupted)
