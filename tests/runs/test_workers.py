"""Workers that are interrupted, and how many there are by default."""

import os
import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from sainet.runs.errors import SainetError
from sainet.runs.workers import core_count, each_done, worker_pool

# Jobs that write where they began and, when they are interrupted, what they keep.
JOBS = """
import pathlib, signal, sys, time
from sainet.runs.workers import each_done, worker_pool

def work(folder, index):
    try:
        (folder / f"began-{index}").touch()
        time.sleep(0.3 if index < 0 else 60)
    except KeyboardInterrupt:
        time.sleep(0.3)  # a second signal comes meanwhile
        (folder / f"kept-{index}").touch()
        raise
    return index

if __name__ == "__main__":
    # A shell has its background jobs ignore the signal, and children inherit that.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    folder, jobs = pathlib.Path(sys.argv[1]), int(sys.argv[2])
    try:
        with worker_pool(2) as pool:
            list(each_done(pool, work, [(folder, -1), (folder, -2)]))
            list(each_done(pool, work, [(folder, index) for index in range(jobs)]))
    except KeyboardInterrupt:
        print("interrupted")
"""


def wait_for(folder: Path, pattern: str, count: int):
    end = time.monotonic() + 60
    while len(list(folder.glob(pattern))) < count:
        assert time.monotonic() < end
        time.sleep(0.05)


@pytest.mark.parametrize("whole_group", [True, False])
@pytest.mark.parametrize("jobs", [1, 5])  # a worker is idle; jobs are waiting
def test_an_interruption_quietly_ends_all_jobs(jobs, whole_group, tmp_path):
    script = tmp_path / "jobs.py"
    script.write_text(JOBS)
    child = subprocess.Popen(
        [sys.executable, str(script), str(tmp_path), str(jobs)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    under_way = min(jobs, 2)
    wait_for(tmp_path, "began-[0-9]", under_way)
    # A terminal signals every process, `kill -INT` one.
    (os.killpg if whole_group else os.kill)(child.pid, signal.SIGINT)
    try:
        said, complaints = child.communicate(timeout=30)
    finally:
        child.kill()
    assert (said, complaints, child.returncode) == ("interrupted\n", "", 0)
    assert len(list(tmp_path.glob("began-[0-9]"))) == under_way
    assert len(list(tmp_path.glob("kept-[0-9]"))) == under_way


# Workers import this module again before they can handle a signal.
SLOW_IMPORT = """
import pathlib, signal, sys, time
from sainet.runs.workers import each_done, worker_pool

if __name__ == "__mp_main__":
    (pathlib.Path(sys.argv[1]) / "imports").touch()
    time.sleep(2)

def work(index):
    pathlib.Path(sys.argv[1], "began").touch()
    return index

if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with worker_pool(2) as pool:
            list(each_done(pool, work, [(1,), (2,)]))
    except KeyboardInterrupt:
        print("interrupted")
"""


def test_an_interruption_while_workers_import_is_quiet_and_not_lost(tmp_path):
    script = tmp_path / "slow.py"
    script.write_text(SLOW_IMPORT)
    child = subprocess.Popen(
        [sys.executable, str(script), str(tmp_path)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    wait_for(tmp_path, "imports", 1)
    os.killpg(child.pid, signal.SIGINT)
    try:
        said, complaints = child.communicate(timeout=30)
    finally:
        child.kill()
    assert (said, complaints, child.returncode) == ("interrupted\n", "", 0)
    assert not (tmp_path / "began").exists()


def test_a_killed_worker_is_reported_with_a_remedy():
    with (
        pytest.raises(SainetError, match="memory ran out.*fewer workers") as told,
        worker_pool(1) as pool,
    ):
        list(each_done(pool, os._exit, [(1,), (2,)]))
    assert told.value.exit_status == 1


def long_job(began: Path):
    """A job that somebody has to interrupt."""
    began.touch()
    time.sleep(60)


@pytest.fixture(params=["foreground", "background"])
def shell(request):
    """A shell has its background jobs ignore what Ctrl-C sends."""
    before = signal.getsignal(signal.SIGINT)
    if request.param == "background":
        signal.signal(signal.SIGINT, signal.SIG_IGN)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.usefixtures("shell")
def test_a_failure_ends_only_the_jobs_of_its_pool(tmp_path):
    with worker_pool(1) as other:
        other.submit(core_count).result()  # its process is there, and idle
        with pytest.raises(ZeroDivisionError), worker_pool(2) as pool:
            for index in range(3):
                pool.submit(long_job, tmp_path / f"began-{index}")
            wait_for(tmp_path, "began-*", 2)
            failed = time.monotonic()
            raise ZeroDivisionError
        assert time.monotonic() - failed < 30
        assert len(list(tmp_path.glob("began-*"))) == 2
        assert other.submit(core_count).result() == core_count()


def affinity(index: int) -> tuple[set[int], int]:
    """What a worker may use; it takes a while, for the other one to begin as well."""
    time.sleep(0.5)
    return os.sched_getaffinity(0), core_count()


@pytest.mark.skipif(not hasattr(os, "sched_setaffinity"), reason="Linux alone has it")
def test_workers_with_a_core_each_share_the_cores_evenly():
    cores, workers = os.sched_getaffinity(0), 2
    with worker_pool(workers, core_each=True) as pool:
        found = list(pool.map(affinity, range(4)))
    assert all(count == 1 and len(own) == 1 for own, count in found)
    assert set().union(*(own for own, _ in found)) <= cores
    assert len({*map(tuple, (own for own, _ in found))}) == min(workers, len(cores))
    with worker_pool(1) as pool:
        assert pool.submit(affinity, 0).result()[0] == cores


def platform() -> str | None:
    import jax

    assert jax.default_backend() == "cpu"
    return os.environ.get("JAX_PLATFORMS")


def test_workers_leave_a_gpu_to_the_process_that_started_them(monkeypatch):
    monkeypatch.delenv("JAX_PLATFORMS", raising=False)
    with worker_pool(1) as pool:
        assert pool.submit(platform).result() == "cpu"


def test_cores_are_counted_where_affinity_is_unknown(monkeypatch):
    assert 1 <= core_count() <= (os.cpu_count() or 1)
    monkeypatch.delattr(os, "sched_getaffinity")
    assert core_count() == os.cpu_count()


def fail_at_once(folder: Path, index: int) -> int:
    if index == 0:
        wait_for(folder, "began", 1)
        raise SainetError("impossible")
    (folder / "began").touch()
    time.sleep(0.5)
    (folder / "ended").touch()
    return index


def test_an_error_is_raised_after_all_running_jobs_have_ended(tmp_path):
    with ThreadPoolExecutor(2) as pool:
        jobs = [(tmp_path, index) for index in range(2)]
        with pytest.raises(SainetError, match="impossible"):
            list(each_done(pool, fail_at_once, jobs))
        assert (tmp_path / "ended").exists()
