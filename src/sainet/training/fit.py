"""The training loop: resumes after any interruption to the same weights, bit for bit."""

import logging
import warnings
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import jax
import numpy as np

from sainet.datasets.batch import PushBatch, to_batch
from sainet.datasets.reader import BatchReader
from sainet.datasets.schema import simulated_name, variables
from sainet.datasets.store import Store
from sainet.engines.assumed import PAPER_FRICTION, PAPER_MASS, PAPER_RADIUS
from sainet.errors import BadInput, BadStore, Diverged
from sainet.models.arrays import load_arrays, save_arrays
from sainet.models.card import CARD, WEIGHTS, Card
from sainet.models.features import FeatureSizes
from sainet.models.interaction import InteractionNetwork
from sainet.runs import (
    MANIFEST,
    RunFolder,
    content_hash,
    manifest,
    open_run,
    read_json,
    write_json,
)
from sainet.training.config import FitConfig, ModelKind
from sainet.training.log import append_log, read_log, rewind_log
from sainet.training.loss import LossWeights
from sainet.training.statistics import feature_scales, loss_weights
from sainet.training.step import FitState, data_loss, even_batch, first_state, make_step

STATE = "state.safetensors"
_STATISTICS_PUSHES = 500  # enough for means and deviations, at any size of store
_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class FitResult:
    """A trained network's folder and what was logged on the way."""

    folder: Path
    history: list[dict[str, Any]]


@dataclass(frozen=True)
class Task:
    """What is trained on what."""

    model: ModelKind
    store: Store
    config: FitConfig
    assumed_engine: str

    @property
    def simulated(self) -> str | None:
        """The assumed engine whose prediction the network sees."""
        return self.assumed_engine if self.model == "sain" else None

    @property
    def names(self) -> tuple[str, ...]:
        """The arrays of the store that training reads."""
        unread = ("truth_pusher", "group", "published")
        skip = lambda name: name.startswith(("simulated_", *unread))  # noqa: E731
        kept = [name for name in variables(self.store.info) if not skip(name)]
        return (*kept, simulated_name(self.assumed_engine))

    @property
    def training_pushes(self) -> int:
        """How many of the store's first pushes are trained on."""
        return self.store.info.pushes - self.config.validation_pushes

    def to_batch(self, arrays: dict[str, np.ndarray], steps: int) -> PushBatch:
        """Turn stored arrays into a batch with what the network sees."""
        return to_batch(
            arrays,
            self.store.info,
            steps=min(steps, self.config.steps),
            simulated=self.simulated,
        )


def fit(
    model: ModelKind,
    store: Store,
    config: FitConfig,
    out: Path,
    *,
    assumed_engine: str = "planar",
    on_step: Callable[[int, float], None] = lambda iteration, loss: None,
) -> FitResult:
    """Train a network, or go on with an interrupted training.

    Args:
        model: `in` or `sain`.
        store: training data.
        config: of the training.
        out: the run folder.
        assumed_engine: whose stored prediction SAIN sees.
        on_step: told the finished iterations and the loss of the last.

    Raises:
        RunConflict: the folder holds something else.
        BadStore: the data lack what the network needs.
        Diverged: the loss left the finite numbers for good.
    """
    task = Task(model, store, config, assumed_engine)
    _check_data(task)
    devices = jax.device_count()
    folder = open_run(out, _settings(task), finished_by=CARD, devices=devices)
    if folder.is_finished:
        _log.info("%s is finished already", out)
        return FitResult(out, read_log(out))
    _warn_of_other_machine(folder, devices)
    state, weights = _begin(task)
    if (out / STATE).is_file():
        state = load_arrays(out / STATE, state)
    history = rewind_log(out, int(state.iteration))
    state = _iterate(task, state, weights, out, history, on_step)
    _finish(task, state.network, folder, history)
    return FitResult(out, history)


def _check_data(task: Task) -> None:
    info, path = task.store.info, task.store.path
    if task.assumed_engine not in info.assumed_engines:
        raise BadStore(
            f"{path}: assumed_engines has no {task.assumed_engine!r}; generate the data "
            f"with --assumed-engine {task.assumed_engine}."
        )
    if task.training_pushes < 1:
        raise BadInput(
            f"--validation-pushes is {task.config.validation_pushes}; {path} has only "
            f"{info.pushes} pushes."
        )


def _settings(task: Task) -> dict[str, Any]:
    return {
        "command": "train",
        "model": task.model,
        "assumed_engine": task.assumed_engine,
        "data": task.store.content,
        **asdict(task.config),
    }


def _warn_of_other_machine(folder: RunFolder, devices: int) -> None:
    before, now = read_json(folder.path / MANIFEST), manifest(devices)
    for name in ("versions", "processor", "devices"):
        if before.get(name) != now[name]:
            warnings.warn(
                f"{folder.path}: {name} was {before.get(name)} when training began and "
                f"is {now[name]} now; the weights will differ in their last bits.",
                stacklevel=3,
            )


def _begin(task: Task) -> tuple[FitState, LossWeights]:
    info = task.store.info
    few = slice(0, min(_STATISTICS_PUSHES, task.training_pushes))
    sample = task.to_batch(task.store.read(few, task.names), info.steps)
    sizes = FeatureSizes(info.kind, task.model == "sain")
    network = InteractionNetwork(
        sizes,
        time_step=info.time_step,
        key=jax.random.key(task.config.seed),
        scales=feature_scales(sample, sizes),
    )
    return first_state(network, task.config), loss_weights(sample, task.config)


def _iterate(
    task: Task,
    state: FitState,
    weights: LossWeights,
    out: Path,
    history: list[dict[str, Any]],
    on_step: Callable[[int, float], None],
) -> FitState:
    config = task.config
    step, validate = make_step(config, weights), _make_validation(task, weights)
    reader = BatchReader(
        task.store, task.names, config.batch_size, config.seed, task.training_pushes
    )
    try:
        for iteration in range(int(state.iteration) + 1, config.iterations + 1):
            batch = even_batch(task.to_batch(*reader.batch(iteration - 1)))
            state, loss = step(state, batch)
            last = iteration == config.iterations
            if iteration % config.log_every == 0 or last:
                line = {"iteration": iteration, "loss": float(loss)}
                line |= validate(state.network)
                _check_finite(line, out)
                append_log(out, line)
                history.append(line)
            if iteration % config.checkpoint_every == 0 or last:
                save_arrays(out / STATE, state)
            on_step(iteration, history[-1]["loss"] if history else float("nan"))
    finally:
        reader.close()
    return state


def _check_finite(line: dict[str, Any], out: Path) -> None:
    if not np.isfinite(line["loss"]):
        raise Diverged(
            f"{out}: the loss is {line['loss']} at iteration {line['iteration']}; "
            "lower --learning-rate or --clip-norm."
        )


def _make_validation(
    task: Task, weights: LossWeights
) -> Callable[[InteractionNetwork], dict[str, float]]:
    """Return what measures the loss on the pushes that are kept for validation."""
    kept = task.config.validation_pushes
    if not kept:
        return lambda network: {}
    part = slice(task.training_pushes, task.store.info.pushes)
    arrays = task.store.read(part, task.names)
    batch = task.to_batch(arrays, task.store.info.steps)
    loss = jax.jit(lambda network: data_loss(network, batch, weights) / kept)
    return lambda network: {"validation_loss": float(loss(network))}


def _finish(
    task: Task,
    network: InteractionNetwork,
    folder: RunFolder,
    history: list[dict[str, Any]],
) -> None:
    info, sain = task.store.info, task.model == "sain"
    assumed = {"mass": PAPER_MASS, "radius": PAPER_RADIUS, "friction": PAPER_FRICTION}
    data = save_arrays(folder.path / WEIGHTS, network)
    card = Card(
        model=task.model,
        kind=info.kind,
        time_step=info.time_step,
        inner_engine=task.assumed_engine if sain else None,
        truth_engine=info.engine,
        assumed=assumed if sain else None,
        data=task.store.content,
        data_seed=info.seed,
        weights=content_hash(data),
        config=asdict(task.config),
        manifest=read_json(folder.path / MANIFEST),
        final_loss=history[-1]["loss"] if history else None,
    )
    write_json(folder.path / CARD, card.to_dict())
    (folder.path / STATE).unlink(missing_ok=True)
