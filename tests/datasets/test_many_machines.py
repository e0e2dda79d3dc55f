"""Datasets made by shards and by Dask workers: the bytes of one process."""

import os
import shutil
import signal
import subprocess
import sys
import time
from contextlib import ExitStack
from importlib.util import find_spec

import pytest

from datasets.stores import SMALL, assert_same_files, small
from runs.dask_cluster import Cluster
from sainet.datasets import schema, writer
from sainet.datasets.generate import generate, generate_share
from sainet.runs.errors import BadInput, RunConflict, SainetError
from sainet.runs.executors import Machines
from sainet.runs.shards import SHARDS, Shard
from support import SOURCE, require

SHARE = """
import sys
from pathlib import Path
from sainet.datasets.config import GenerateConfig
from sainet.datasets.generate import generate_share
from sainet.runs.shards import Shard
generate_share(
    GenerateConfig(**eval(sys.argv[1])), Path(sys.argv[2]), Shard.parse(sys.argv[3])
)
"""


def start_share(out, shard: str) -> subprocess.Popen:
    """A shard in a process of its own."""
    command = [sys.executable, "-c", SHARE, repr(SMALL), str(out), shard]
    environment = os.environ | {"PYTHONPATH": str(SOURCE.parent)}
    return subprocess.Popen(command, env=environment)


def chunks(out) -> int:
    """The number of finished chunks."""
    return len(list((out / writer.PROGRESS).glob("chunk-*.json")))


def wait_for_chunk(out):
    end = time.monotonic() + 120
    while not chunks(out):
        assert time.monotonic() < end
        time.sleep(0.002)


@pytest.mark.slow
def test_shards_at_once_make_the_bytes_of_one_process(whole_store, tmp_path, caplog):
    out = tmp_path / "store"
    running = [start_share(out, f"{number}/3") for number in (1, 2)]
    wait_for_chunk(out)
    running[1].kill()
    assert running[0].wait() == 0
    running[1].wait()
    seen = []
    assert generate_share(small(), out, Shard(3, 3), on_pushes=seen.append) == 8
    assert seen == [0, 5, 3]
    assert (out / SHARDS).is_dir()
    assert not (out / schema.HASHES).exists()
    missing = 6 - chunks(out)
    generate(small(), out)
    assert_same_files(out, whole_store)
    line = f"{out}: {missing} of 6 pieces are missing from 3 shards; they are made now."
    assert caplog.messages == ([line] if missing else [])
    assert generate_share(small(), out, Shard(1, 3)) == 10  # finished: nothing is done
    assert_same_files(out, whole_store)


def test_all_shards_one_after_another_make_the_same_bytes(whole_store, tmp_path):
    out = tmp_path / "store"
    for number in (3, 1, 2):
        generate_share(small(), out, Shard(number, 3))
    generate(small(), out)
    assert_same_files(out, whole_store)


def test_a_changed_chunk_of_a_shard_is_named(whole_store, tmp_path):
    out = tmp_path / "store"
    generate_share(small(), out, Shard(2, 6))
    path = out / schema.ARRAYS / "truth" / "c" / "1" / "0" / "0" / "0"
    before = path.read_bytes()
    path.write_bytes(b"x")
    for again in (None, Shard(2, 6)):
        with pytest.raises(
            BadInput, match="truth/c/1/0/0/0: seal: .*edited. Delete it"
        ):
            generate_share(small(), out, again) if again else generate(small(), out)
    with pytest.raises(RunConflict, match="seed is 0, not 1"):
        generate_share(small(seed=1), out, Shard(1, 6))
    path.write_bytes(before)
    generate(small(), out)
    assert_same_files(out, whole_store)


@pytest.mark.slow
def test_dask_makes_the_bytes_of_one_process_though_workers_die(whole_store, tmp_path):
    require(find_spec("distributed"), "distributed is not installed")
    out, folder = tmp_path / "store", tmp_path / "cluster"
    folder.mkdir()
    with ExitStack() as stack:
        cluster = stack.enter_context(Cluster(folder))
        workers = [cluster.add_worker() for _ in range(2)]
        executor = stack.enter_context(Machines(cluster.address).executor())

        def kill_one(pushes):
            if workers and chunks(out):
                workers[0].send_signal(signal.SIGKILL)
                workers.clear()

        generate(small(), out, executor=executor, on_pushes=kill_one)
        assert not workers
        assert_same_files(out, whole_store)
        shutil.rmtree(out)
        # The scheduler dies; the same call without it goes on.
        with pytest.raises(SainetError, match="connection to the Dask scheduler"):
            generate(
                small(),
                out,
                executor=executor,
                on_pushes=lambda pushes: cluster.scheduler.kill(),
            )
    generate(small(), out)
    assert_same_files(out, whole_store)
