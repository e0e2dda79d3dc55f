"""The training loop: resumes after any interruption to the same weights."""

import logging
import warnings
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import jax
import numpy as np

from sainet.datasets.reader import BatchReader
from sainet.datasets.store import Store
from sainet.engines.assumed import beliefs
from sainet.errors import Diverged
from sainet.models.arrays import load_arrays, save_arrays
from sainet.models.card import CARD, WEIGHTS, Card
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
from sainet.training.step import FitState, data_loss, even_batch, make_step
from sainet.training.task import Task, begin, check_data, settings

STATE = "state.safetensors"
_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class FitResult:
    """A trained network's folder and what was logged on the way."""

    folder: Path
    history: list[dict[str, Any]]


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
        on_step: told the finished iterations and the loss that was last logged.

    Raises:
        RunConflict: the folder holds something else.
        BadStore: the data lack what the network needs.
        Diverged: the loss left the finite numbers for good.
    """
    task = Task(model, store, config, assumed_engine)
    check_data(task)
    devices = jax.device_count()
    folder = open_run(out, settings(task), finished_by=CARD, devices=devices)
    if folder.is_finished:
        _log.info("%s is finished already", out)
        return FitResult(out, read_log(out))
    _warn_of_other_machine(folder, devices)
    state, weights = begin(task)
    if (out / STATE).is_file():
        state = load_arrays(out / STATE, state)
    history = rewind_log(out, int(state.iteration))
    # Where the step leaves it: otherwise its first call compiles a second time.
    state = jax.device_put(state, jax.devices()[0])
    state = _iterate(task, state, weights, out=out, history=history, on_step=on_step)
    _finish(task, state.network, folder, history)
    return FitResult(out, history)


def _warn_of_other_machine(folder: RunFolder, devices: int) -> None:
    before, now = read_json(folder.path / MANIFEST), manifest(devices)
    for name in ("versions", "processor", "devices"):
        if before.get(name) != now[name]:
            warnings.warn(
                f"{folder.path}: {name} was {before.get(name)} when training began and "
                f"is {now[name]} now; the weights will differ in their last bits.",
                stacklevel=3,
            )


def _iterate(
    task: Task,
    state: FitState,
    weights: LossWeights,
    *,
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
    known = int(batch.is_observed.sum())
    loss = jax.jit(lambda network: data_loss(network, batch, weights) / known)
    return lambda network: {"validation_loss": float(loss(network))}


def _finish(
    task: Task,
    network: InteractionNetwork,
    folder: RunFolder,
    history: list[dict[str, Any]],
) -> None:
    info, sain = task.store.info, task.model == "sain"
    data = save_arrays(folder.path / WEIGHTS, network)
    card = Card(
        model=task.model,
        kind=info.kind,
        time_step=info.time_step,
        inner_engine=task.assumed_engine if sain else None,
        truth_engine=info.engine,
        assumed=beliefs(task.assumed_engine) if sain else None,
        data=task.store.content,
        data_seed=info.seed,
        weights=content_hash(data),
        config=asdict(task.config),
        manifest=read_json(folder.path / MANIFEST),
        recurrent=task.config.recurrent,
        final_loss=history[-1]["loss"] if history else None,
    )
    write_json(folder.path / CARD, card.to_dict())
    (folder.path / STATE).unlink(missing_ok=True)
