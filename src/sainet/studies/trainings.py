"""Networks that are trained at once, each by a process with a core of its own.

A batch that is split over cores waits for the slowest of them at every iteration, and
small parts of it keep none busy. Networks that do not know of each other never wait.
"""

from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass, replace
from pathlib import Path

from sainet.datasets.store import Store
from sainet.learning.config import FitConfig, ModelKind
from sainet.learning.fit import FitResult, fit
from sainet.learning.log import read_log
from sainet.models.card import CARD
from sainet.runs.workers import worker_lost

_LOOK_AGAIN = 1.0  # s


@dataclass(frozen=True)
class Training:
    """What makes one network: the arguments of `fit`."""

    model: ModelKind
    store: Store
    config: FitConfig
    out: Path
    assumed_engine: str = "planar"
    start_from: str | None = None

    @property
    def name(self) -> str:
        """The name of its folder."""
        return self.out.name

    @property
    def is_finished(self) -> bool:
        """Whether a network is there; `run` checks whether it is this one."""
        return (self.out / CARD).is_file()

    def of_seeds(self, seeds: Sequence[int]) -> list["Training"]:
        """Return a training for each seed, with a folder of its own.

        Each goes on from the network of its own seed, if from any.
        """
        return [
            replace(
                self,
                config=replace(self.config, seed=seed),
                out=self.out.with_name(of_seed(self.name, seed)),
                start_from=self.start_from and of_seed(self.start_from, seed),
            )
            for seed in seeds
        ]

    def run(
        self, on_step: Callable[[int, float], None] = lambda iteration, loss: None
    ) -> FitResult:
        """Train the network, or go on; see `fit` for what is told and raised."""
        return fit(
            self.model,
            self.store,
            self.config,
            self.out,
            assumed_engine=self.assumed_engine,
            start_from=self.start_from,
            on_step=on_step,
        )


def of_seed(name: str, seed: int) -> str:
    """Return what a training's folder is called."""
    return f"{name}-seed-{seed}"


def train_at_once(
    trainings: Sequence[Training],
    trainers: Executor,
    on_step: Callable[[int, str], None],
) -> None:
    """Train networks, as many at once as there are processes.

    Args:
        trainings: which do not go on from each other.
        trainers: processes that have a core each.
        on_step: told now and then the finished iterations of all together, and the
            losses of those under way.

    Raises:
        SainetError: what `fit` raises, of the first that fails; or a process was ended
            from outside.
    """
    futures: dict[Future[None], Training] = {}
    try:
        for training in trainings:
            futures[trainers.submit(_run, training)] = training
        waiting = set(futures)
        while waiting:
            done, waiting = wait(waiting, _LOOK_AGAIN, FIRST_COMPLETED)
            for future in done:
                future.result()
            on_step(*_look(futures))
    except BrokenProcessPool:
        raise worker_lost() from None
    finally:
        for future in futures:
            future.cancel()


def _run(training: Training) -> None:
    training.run()


def _look(futures: dict[Future[None], Training]) -> tuple[int, str]:
    """Read the logs: iterations so far, and what to say of those under way."""
    total, losses = 0, []
    for future, training in futures.items():
        if future.done():
            total += training.config.iterations  # all it will make
        elif lines := read_log(training.out):
            total += int(lines[-1]["iteration"])
            losses.append(f"{lines[-1]['loss']:.3g}")
    return total, f"losses {', '.join(losses)}" if losses else ""
