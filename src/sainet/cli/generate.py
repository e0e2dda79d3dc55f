"""`sainet generate`."""

from dataclasses import dataclass, field
from pathlib import Path

from tyro.conf import Positional

from sainet.cli.output import Json, Output, progress_bar
from sainet.datasets.config import GenerateConfig
from sainet.runs.workers import worker_pool
from sainet.worlds.config import SetupName


@dataclass(frozen=True, kw_only=True)
class Settings(GenerateConfig):
    """Simulated pushes with the distributions of the paper (section IV-B).

    A range is a uniform distribution between two numbers, or one constant.
    """

    setup: Positional[SetupName] = "robot"
    """Setup: robot (the pusher follows a path) or direct-force (a force drives it)."""


@dataclass(frozen=True, kw_only=True)
class Generate:
    """Simulate pushes with the paper's distributions, and store them as a dataset."""

    config: Settings = field(default_factory=Settings)
    out: Path
    """Run folder to write; identical settings resume."""
    workers: int | None = None
    """Number of processes, which does not affect the result. Default: one per core."""
    output: Output = field(default_factory=Output)

    def run(self) -> Json:
        """Generate the dataset."""
        from sainet.datasets.generate import generate

        bar = progress_bar("Simulating", self.config.pushes, self.output)
        with worker_pool(self.workers) as pool, bar as advance:
            store = generate(
                self.config,
                self.out,
                executor=pool,
                on_pushes=lambda pushes: advance(pushes, ""),
            )
        self.output.say(f"{store.info.pushes} pushes are in {self.out}")
        return {"out": str(self.out), "pushes": store.info.pushes}
