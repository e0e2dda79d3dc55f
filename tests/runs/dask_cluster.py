"""A Dask scheduler and workers on the loopback interface, which tests may kill."""

import json
import os
import subprocess
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path

from support import SOURCE


@dataclass
class Cluster:
    """Processes that are killed when the test is over."""

    folder: Path
    scheduler: subprocess.Popen | None = None
    workers: list[subprocess.Popen] = field(default_factory=list)

    def __enter__(self):
        """Start the scheduler."""
        words = ("--host", "127.0.0.1", "--port", "0", "--no-dashboard", "--no-show")
        self.scheduler = self._start("dask_scheduler", *words)
        end = time.monotonic() + 60
        while not (self.folder / "scheduler.json").exists():
            assert self.scheduler.poll() is None
            assert time.monotonic() < end
            time.sleep(0.05)
        return self

    def __exit__(self, *error):
        for process in (*self.workers, self.scheduler):
            process.kill()
            process.wait()

    @property
    def address(self) -> str:
        """The address of the scheduler."""
        return json.loads((self.folder / "scheduler.json").read_text())["address"]

    def add_worker(self, threads: int = 1) -> subprocess.Popen:
        """Start a worker, which nothing starts again."""
        words = ("--nthreads", str(threads), "--no-nanny", "--no-dashboard")
        found = self._start("dask_worker", *words, "--host", "127.0.0.1")
        self.workers.append(found)
        return found

    def _start(self, module: str, *words: str) -> subprocess.Popen:
        file = str(self.folder / "scheduler.json")
        command = [sys.executable, "-m", f"distributed.cli.{module}"]
        command += [*words, "--scheduler-file", file]
        paths = [str(SOURCE.parent), os.environ.get("PYTHONPATH", "")]
        environment = os.environ | {"PYTHONPATH": os.pathsep.join(paths)}
        return subprocess.Popen(
            command, cwd=self.folder, env=environment, stderr=subprocess.DEVNULL
        )
