"""A training that `kill -9` stopped ends in the bytes of one that nobody disturbed."""

import os
import signal
import subprocess
import sys

import pytest

from learning.stores import quiet_store
from sainet.learning.job import STATE
from sainet.learning.log import LOG
from sainet.models.card import CARD, WEIGHTS
from support import SOURCE

ITERATIONS, STOP = 60, 27  # the last checkpoint before it is that of iteration 20

# One device on any machine; reports its position and waits for its end on request.
CHILD = f"""
import sys, time
from pathlib import Path
import jax
jax.config.update("jax_num_cpu_devices", 1)
from sainet.datasets.store import open_store
from sainet.learning.recipes import PAPER
from sainet.learning.fit import fit

data, out, stop = Path(sys.argv[1]), Path(sys.argv[2]), int(sys.argv[3])

def report(iteration, loss):
    print(iteration, flush=True)
    if iteration == stop:
        time.sleep(600)

config = PAPER.changed(
    iterations={ITERATIONS}, batch_size=6, average=10, log_every=5, checkpoint_every=10
)
fit("sain", open_store(data), config, out, on_step=report)
"""


def train(store, out, *, stop=0):
    environment = os.environ | {"PYTHONPATH": str(SOURCE.parent)}
    return subprocess.Popen(
        [sys.executable, "-c", CHILD, str(store.path), str(out), str(stop)],
        stdout=subprocess.PIPE,
        text=True,
        env=environment,
    )


def iterations(process) -> list[int]:
    """Wait for the end of a training run and return its report."""
    with process:
        found = [int(line) for line in process.stdout]
    assert process.returncode == 0
    return found


def kill_at(process, iteration: int):
    """Kills a training right after an iteration, which it waits at."""
    with process:
        for line in process.stdout:
            if int(line) == iteration:
                process.send_signal(signal.SIGKILL)
    assert process.returncode == -signal.SIGKILL


@pytest.mark.slow
def test_a_killed_training_run_ends_byte_identical(tmp_path, tmp_path_factory):
    store = quiet_store(tmp_path_factory.getbasetemp())
    calm, killed = tmp_path / "calm", tmp_path / "killed"
    undisturbed = train(store, calm)
    kill_at(train(store, killed, stop=STOP), STOP)
    assert (killed / STATE).is_file()
    assert not (killed / CARD).exists()
    assert iterations(undisturbed) == list(range(1, ITERATIONS + 1))
    assert iterations(train(store, killed)) == list(range(21, ITERATIONS + 1))
    for name in (WEIGHTS, LOG, CARD):
        assert (killed / name).read_bytes() == (calm / name).read_bytes(), name
