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
from sainet.learning.fit import FitResult, fit
from sainet.learning.log import read_log
from sainet.learning.recipes import FromModel, ModelKind, Recipe
from sainet.models.card import CARD
from sainet.runs.workers import worker_lost
from sainet.studies.config import Scale

_LOOK_AGAIN = 1.0  # s
_QUICK_ITERATIONS = 20


@dataclass(frozen=True)
class Training:
    """What makes one network: the arguments of `fit`."""

    model: ModelKind
    store: Store
    recipe: Recipe
    out: Path
    assumed_engine: str = "planar"

    @property
    def name(self) -> str:
        """The name of its folder."""
        return self.out.name

    @property
    def iterations(self) -> int:
        """The number of its iterations."""
        return self.recipe.optimiser.iterations

    @property
    def is_finished(self) -> bool:
        """Whether a network is there; `run` checks whether it is this one."""
        return (self.out / CARD).is_file()

    def of_seeds(self, seeds: Sequence[int]) -> list["Training"]:
        """Return a training for each seed, with a folder of its own.

        A training that starts from a network starts from that of its own seed.
        """
        return [self._of_seed(seed) for seed in seeds]

    def _of_seed(self, seed: int) -> "Training":
        recipe, out = self.recipe.changed(seed=seed), of_seed(self.name, seed)
        if isinstance(recipe.start, FromModel):
            start = FromModel(of_seed(recipe.start.model, seed))
            recipe = recipe.changed(start=start)
        return replace(self, recipe=recipe, out=self.out.with_name(out))

    def run(
        self, on_step: Callable[[int, float | None], None] = lambda done, loss: None
    ) -> FitResult:
        """Train the network, or resume; see `fit` for `on_step` and errors."""
        return fit(
            self.model,
            self.store,
            self.recipe,
            self.out,
            assumed_engine=self.assumed_engine,
            on_step=on_step,
        )


def scaled(recipe: Recipe, scale: Scale, pushes: int) -> Recipe:
    """Return a recipe for so many pushes: the quick scale has a few iterations."""
    size = min(recipe.optimiser.batch_size, pushes)
    quick = {"iterations": _QUICK_ITERATIONS} if scale == "quick" else {}
    return recipe.changed(batch_size=size, **quick)


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
            total += training.iterations
        elif lines := read_log(training.out):
            total += int(lines[-1]["iteration"])
            losses.append(f"{lines[-1]['loss']:.3g}")
    return total, f"losses {', '.join(losses)}" if losses else ""
