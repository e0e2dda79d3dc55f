"""The training loop, which resumes after interruptions to the same weights."""

import logging
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from sainet.datasets.store import Store
from sainet.engines.simulator import InternalEngine
from sainet.learning.checks import other_disks
from sainet.learning.job import Job, begin, finish
from sainet.learning.log import LogLine, read_log
from sainet.learning.mixture import Batches
from sainet.learning.recipes import Recipe
from sainet.learning.step import make_step
from sainet.models.identity import ModelKind
from sainet.runs.interrupts import raise_if_interrupted

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class FitResult:
    """A trained network's folder and the log of its training."""

    folder: Path
    history: tuple[LogLine, ...]

    @property
    def loss(self) -> float | None:
        """The last logged loss of training; None without iterations."""
        return self.history[-1].loss if self.history else None


def fit(
    model: ModelKind,
    store: Store | Sequence[Store],
    recipe: Recipe,
    out: Path,
    *,
    engine: str | InternalEngine = "planar",
    on_step: Callable[[int, float | None], None] = lambda iteration, loss: None,
) -> FitResult:
    """Train a network, or resume an interrupted training run.

    Args:
        model: `in` or `sain`.
        store: training data; several datasets, of different numbers of disks, train
            one network.
        recipe: with the start of training; `recipe_for` returns the one that fits a
            start.
        out: the run folder.
        engine: internal engine of SAIN: the name of a simulator, or the folder of
            identified parameters, whose prediction is then computed; or the engine.
        on_step: called with the number of finished iterations and the last logged loss,
            None before the first.

    Raises:
        RunConflict: the folder contains something else.
        BadStore: the data lack inputs of the network, or datasets differ in their
            setup, time step or engine.
        BadInput: there is no dataset, or the recipe does not fit the model.
        BadCheckpoint: training cannot start from that network.
        Diverged: the loss became NaN or infinite.
    """
    job = begin(model, store, recipe, out, engine=engine)
    if job is None:
        _log.info("%s is already finished", out)
        return FitResult(out, read_log(out))
    for task in job.mixture.tasks:
        for warning in other_disks(task):
            _log.warning("%s", warning)
    complete(job, on_step)
    return FitResult(out, tuple(job.progress.history))


def complete(job: Job, on_step: Callable[[int, float | None], None]) -> None:
    """Train a network to the end; see `fit`.

    Raises:
        Diverged: the loss became NaN or infinite.
    """
    _iterate(job, on_step)
    finish(job)


def _iterate(job: Job, on_step: Callable[[int, float | None], None]) -> None:
    progress = job.progress
    steps = [make_step(job.recipe, each, job.drawn_to) for each in job.weights]
    batches = Batches(job.mixture)
    try:
        for iteration in job.left:
            raise_if_interrupted()
            turn, batch = batches.take(iteration)
            progress.state, loss = steps[turn](progress.state, batch)
            is_over = job.note(iteration, loss)
            on_step(iteration, progress.last_loss)
            if is_over:
                break
    finally:
        batches.close()
