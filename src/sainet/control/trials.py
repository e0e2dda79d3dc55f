"""Many episodes, each with its own goal, table and noise: seeded and resumable."""

from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import jax

from sainet.control.config import ControlConfig
from sainet.control.episode import Episode, run_episode
from sainet.control.record import (
    SUMMARY,
    Finished,
    episode_file,
    read_record,
    record,
)
from sainet.control.trial import make_trial
from sainet.engines import make_engine
from sainet.models.library import Model, load_model
from sainet.planning import make_planner
from sainet.planning.base import AbstractPlanner
from sainet.runs.documents import write_document, write_json
from sainet.runs.folders import open_run
from sainet.runs.workers import each_done
from sainet.scenes.scene import TIME_STEP

Told = Callable[[dict[str, Any]], None]


def run_trials(
    config: ControlConfig,
    out: Path,
    *,
    executor: Executor | None = None,
    on_episode: Told = lambda episode: None,
) -> list[dict[str, Any]]:
    """Return the records of all trials; only missing episodes are run.

    Args:
        config: model, planner, world and goals.
        out: the run folder, with one file per episode.
        executor: runs the episodes; None runs them in this process, one by one.
        on_episode: called with each record when it is available.

    Raises:
        RunConflict: the folder belongs to another run.
        BadInput: the model is for other pushes, or an episode is damaged.
    """
    model, _ = prepare(config)  # report errors before any output
    settings = {"command": "control", "weights": model.digest, **asdict(config)}
    folder = open_run(out, settings, finished_by=SUMMARY, devices=jax.device_count())
    files = [episode_file(out, trial) for trial in range(config.trials)]
    known = {index for index, path in enumerate(files) if path.is_file()}
    for index in sorted(known):
        on_episode(read_record(files[index]))
    missing = [(config, out, i) for i in range(config.trials) if i not in known]
    for index in each_done(executor, run_trial, missing):
        on_episode(read_record(files[index]))
    records = [read_record(path) for path in files]
    names = [path.relative_to(out).as_posix() for path in files]
    write_document(folder.path / SUMMARY, Finished(names))
    return records


def run_trial(config: ControlConfig, out: Path, index: int) -> int:
    """Run and record one episode (the job of a worker) and return its index.

    The record of an interrupted episode has another name.
    """
    model, planner = prepare(config)
    trial, episode = make_trial(config, index), Episode()
    aim = replace(trial.task, tolerance=config.aim * config.tolerance)
    path = episode_file(out, index)
    try:
        run_episode(
            trial.robot,
            planner,
            model.dynamics,
            aim,
            trial.scene,
            pushes=config.pushes,
            episode=episode,
        )
    except KeyboardInterrupt:
        left = path.with_suffix(".interrupted.json")
        write_json(left, record(config, index, trial, episode))
        raise
    write_json(path, record(config, index, trial, episode))
    path.with_suffix(".interrupted.json").unlink(missing_ok=True)
    return index


def prepare(config: ControlConfig) -> tuple[Model, AbstractPlanner]:
    """Return model and planner; loading the same model again compiles nothing.

    Raises:
        BadInput: model, planner or world is unknown, or the model is for other pushes.
    """
    model = load_model(config.model)
    model.check_fits("robot", TIME_STEP)
    planner = make_planner(config.planner, deadline=config.deadline)
    make_engine(config.world)
    return model, planner
