"""Many episodes, each with its own goal, table and noise: seeded and resumable."""

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from contextlib import suppress
from dataclasses import replace
from functools import partial
from itertools import chain
from os import PathLike, fspath
from pathlib import Path
from tempfile import TemporaryDirectory

import jax
import numpy as np
import xarray as xr

from sainet.control.config import ControlConfig
from sainet.control.episode import SOLVED, Episode, run_episode
from sainet.control.record import (
    SUMMARY,
    EpisodeRecord,
    Finished,
    episode_file,
    read_record,
    record,
)
from sainet.control.trial import make_trial
from sainet.engines import make_engine
from sainet.evaluation.measurements import Condition, Header, Measurements
from sainet.identification.adaptation import Adaptation, check_adapts
from sainet.models.dynamics import AbstractDynamics
from sainet.models.identity import ModelId
from sainet.models.library import Loadable, as_model, load_model
from sainet.models.model import Model
from sainet.planning import make_planner
from sainet.planning.base import AbstractPlanner
from sainet.runs.documents import write_document
from sainet.runs.errors import BadInput, SainetError, require
from sainet.runs.folders import open_run
from sainet.runs.shards import Shard, collect, open_share
from sainet.runs.workers import each_done
from sainet.scenes.scene import TIME_STEP


def run_trials(
    config: ControlConfig,
    out: PathLike[str] | str | None = None,
    *,
    model: Loadable | None = None,
    executor: Executor | None = None,
    on_episode: Callable[[EpisodeRecord], None] = lambda episode: None,
) -> list[EpisodeRecord]:
    """Return the records of all trials; only missing episodes are run.

    Args:
        config: model, planner, world and goals.
        out: the run folder, with one file per episode; None: a temporary folder,
            deleted at the end.
        model: that plans, in the place of that of `config`: of your own for example,
            as `load` takes it. A folder knows it by name and weights only: give a
            function that you changed another folder.
        executor: runs the episodes; None runs them in this process, one by one.
        on_episode: called with each record when it is available.

    Raises:
        RunConflict: the folder belongs to another run.
        BadInput: the model is for other pushes, or an episode is damaged.
    """
    is_config = isinstance(config, ControlConfig)  # pyright: ignore
    wanted = "a ControlConfig; give a model of your own as `model`"
    require(is_config, "config", wanted, config)
    if out is None:
        with TemporaryDirectory() as temporary:
            run = partial(run_trials, model=model, executor=executor)
            return run(config, temporary, on_episode=on_episode)
    config, own, out = *_with_model(config, model), Path(out)
    loaded, _ = prepare(config, own)  # report errors before any output
    settings = _settings(loaded, config)
    folder = open_run(out, settings, finished_by=SUMMARY, devices=jax.device_count())
    shards = None if folder.is_finished else collect(out, settings)
    files = [episode_file(out, trial) for trial in range(config.trials)]
    known = {index for index, path in enumerate(files) if path.is_file()}
    for index in sorted(known):
        on_episode(read_record(files[index]))
    missing = [(config, out, i, own) for i in range(config.trials) if i not in known]
    if shards is not None:
        shards.tell(len(missing), config.trials)
    for index in each_done(executor, run_trial, missing):
        on_episode(read_record(files[index]))
    if shards is not None:
        shards.clear()
    if not folder.is_finished:
        names = [path.relative_to(out).as_posix() for path in files]
        write_document(folder.path / SUMMARY, Finished(names))
    return [read_record(path) for path in files]


def _with_model(
    config: ControlConfig, model: Loadable | None
) -> tuple[ControlConfig, Model | None]:
    """Return settings that name a model, and the model itself unless it is a name."""
    if model is None:
        return config, None
    if isinstance(model, Model | AbstractDynamics):
        own = as_model(model)
        return replace(config, model=own.name), own
    return replace(config, model=fspath(model)), None


def _settings(model: Model, config: ControlConfig) -> dict[str, object]:
    """Return the settings that decide the episodes, as JSON values."""
    # Its folder may be spelled in several ways.
    known = {"weights": model.digest, "model": model.name}
    return {"command": "control", **config.settings(), **known}


def run_share(
    config: ControlConfig,
    out: Path,
    shard: Shard,
    *,
    executor: Executor | None = None,
    on_episode: Callable[[EpisodeRecord], None] = lambda episode: None,
) -> int:
    """Run the trials of a shard, and return their number.

    `run_trials` with equal arguments runs the missing ones and returns the records.

    Raises:
        RunConflict: the folder belongs to another run, or to shards of other versions.
        BadInput: the model is for other pushes, or an episode is damaged.
    """
    model, _ = prepare(config)
    settings = _settings(model, config)
    devices = jax.device_count()
    folder = open_run(out, settings, finished_by=SUMMARY, devices=devices, shared=True)
    own = shard.own(config.trials)
    if folder.is_finished:
        return len(own)
    with open_share(out, settings, shard) as share:
        known = [index for index in own if episode_file(out, index).is_file()]
        missing = [(config, out, index) for index in own if index not in known]
        for index in chain(known, each_done(executor, run_trial, missing)):
            path = episode_file(out, index)
            on_episode(read_record(path))
            share.add(f"episode {index}")
    return len(own)


def run_trial(
    config: ControlConfig, out: Path, index: int, own: Model | None = None
) -> int:
    """Run and record one episode (the job of a worker) and return its index.

    The record of an episode that Ctrl-C or an error ended has another name.
    """
    model, planner = prepare(config, own)
    trial, episode = make_trial(config, index), Episode()
    task = replace(trial.task, tolerance=config.stopping_tolerance * config.tolerance)
    path = episode_file(out, index)
    with trial.robot as robot:
        try:
            run_episode(
                robot,
                planner,
                model,
                task,
                trial.scene,
                pushes=config.pushes,
                episode=episode,
                adaptation=Adaptation(model, trial.scene) if config.adapt else None,
            )
        except (KeyboardInterrupt, SainetError) as error:
            episode.reason = str(error) or episode.reason
            left = path.with_suffix(".interrupted.json")
            end = episode.final
            # A robot that cannot observe must not be asked where the disks are now.
            if isinstance(error, KeyboardInterrupt):
                with suppress(SainetError):
                    end = robot.truth
            if end is not None:
                write_document(left, record(config, index, trial, episode, end))
            raise
    write_document(path, record(config, index, trial, episode))
    path.with_suffix(".interrupted.json").unlink(missing_ok=True)
    return index


def rehearse_trials(config: ControlConfig, *, on_trial: Callable[[int], None]) -> None:
    """Show the commands of the first push of every trial; nothing is sent."""
    model, planner = prepare(config)
    for index in range(config.trials):
        trial = make_trial(config, index)
        with trial.robot as robot:
            run_episode(robot, planner, model, trial.task, trial.scene, pushes=1)
        on_trial(index)


def prepare(
    config: ControlConfig, own: Model | None = None
) -> tuple[Model, AbstractPlanner]:
    """Return model and planner; loading the same model again compiles nothing.

    Args:
        config: names the model.
        own: model in its place.

    Raises:
        BadInput: model, planner or world is unknown, or the model is for other pushes.
    """
    follows = config.swapped and config.given_properties == "true"
    model = own or load_model(config.model, order=(1, 0) if follows else None)
    model.check_fits("robot", TIME_STEP)
    if config.adapt:
        check_adapts(model)
    if config.expected_cost and not model.dynamics.has_regions:
        raise BadInput(
            f"`expected_cost` needs a model with regions; {model.name} has none, fit a "
            "Gaussian process or train an ensemble."
        )
    planner = make_planner(
        config.planner, deadline=config.deadline, expected=config.expected_cost
    )
    make_engine(config.world)
    return model, planner


def measure_trials(
    records: Mapping[ModelId, Sequence[EpisodeRecord]],
    condition: Condition | None = None,
) -> Measurements:
    """Return the measurements of trials.

    Args:
        records: of each model, the same goals in the same order.
        condition: that all trials belong to.
    """
    found = list(records.values())
    count = len(found[0])
    longest = max(len(each.decision_s) for part in found for each in part)
    seconds = np.full((len(found), count, longest), np.nan)
    for model, part in enumerate(found):
        for trial, each in enumerate(part):
            seconds[model, trial, : len(each.decision_s)] = each.decision_s
    columns = {
        "solved": [[float(each.solved) for each in part] for part in found],
        # The measured pose may lie within the tolerance while the true one does not.
        "ended": [[float(each.reason == SOLVED) for each in p] for p in found],
        "pushes": [[float(each.pushes) for each in part] for part in found],
        # An episode that diverged ended infinitely far from its goal.
        "final_mm": [
            [np.inf if e.final_mm is None else e.final_mm for e in part]
            for part in found
        ],
        "overshoot_mm": [[each.overshoot_mm for each in part] for part in found],
        "stuck": [[float(each.is_stuck) for each in part] for part in found],
    }
    numbers = np.arange(count, dtype=np.int32)
    places = {"condition": 0 * numbers, "fold": 0 * numbers - 1, "row": numbers}
    data = xr.Dataset(
        {name: (("model", "sample"), values) for name, values in columns.items()}
        | {"decision_s": (("model", "sample", "decision"), seconds)},
        {name: ("sample", values) for name, values in places.items()},
    )
    return Measurements(
        data, Header(models=tuple(records), conditions=(condition or Condition(),))
    )
