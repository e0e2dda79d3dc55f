"""Many episodes, each with its own goal, table and noise: seeded and resumable."""

from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import asdict, replace
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from sainet.control.config import ControlConfig
from sainet.control.episode import Episode, run_episode
from sainet.control.record import read_record, record
from sainet.engines import make_engine
from sainet.engines.assumed import PAPER_FRICTION, PAPER_MASS, PAPER_RADIUS
from sainet.engines.config import NoiseConfig, at_level
from sainet.engines.identified import FILE
from sainet.models.named import NamedDynamics
from sainet.models.registry import load_dynamics
from sainet.planning import make_planner
from sainet.planning.base import AbstractPlanner
from sainet.processes import each_done
from sainet.robots.simulated import SimulatedRobot
from sainet.runs import content_hash, open_run, write_json
from sainet.scene import TIME_STEP, Scene, State, at_rest
from sainet.tasks.goals import draw_goal
from sainet.tasks.push_to_goal import PushToGoal

SUMMARY = "episodes.json"
FOLDER = "episodes"
# The disks that are pushed: unlike those that the assumed engine believes in.
MASS = (0.9, 1.0)  # kg
RADIUS = (0.054, 0.059)  # m
CONTACT_FRICTION, PUSHER_RADIUS = 0.25, 0.0048
_TABLE_FRICTION = (0.05, 0.25)
_WORLD = 0x3071D
# Settings that came later: a folder from before, which lacks them, had these.
_LATER = {"aim": 1.0}

Told = Callable[[dict[str, Any]], None]


class Trial(NamedTuple):
    """One goal and the world that it lies in."""

    robot: SimulatedRobot
    task: PushToGoal
    scene: Scene  # as model and task believe it


def run_trials(
    config: ControlConfig,
    out: Path,
    *,
    executor: Executor | None = None,
    on_episode: Told = lambda episode: None,
) -> list[dict[str, Any]]:
    """Push to every goal, or go on with what is missing; returns the records.

    Args:
        config: model, planner, world and goals.
        out: the run folder; an episode is a file in it.
        executor: runs the episodes; None runs them here, one by one.
        on_episode: told each record when it is there.

    Raises:
        RunConflict: the folder holds something else.
        BadInput: the model cannot be used for such pushes, or an episode is damaged.
    """
    model, _ = prepare(config)  # what is wrong is said before anything is made
    settings = {"command": "control", "weights": _weights(model), **asdict(config)}
    for name, before in _LATER.items():
        if settings[name] == before:
            del settings[name]
    open_run(out, settings, finished_by=SUMMARY, devices=jax.device_count())
    files = [episode_file(out, trial) for trial in range(config.trials)]
    known = {index for index, path in enumerate(files) if path.is_file()}
    for index in sorted(known):
        on_episode(read_record(files[index]))
    missing = [(config, out, i) for i in range(config.trials) if i not in known]
    for index in each_done(executor, run_trial, missing):
        on_episode(read_record(files[index]))
    records = [read_record(path) for path in files]
    write_json(out / SUMMARY, {"episodes": [str(p.relative_to(out)) for p in files]})
    return records


def _weights(model: NamedDynamics) -> str | None:
    """Return the hash of what was trained or identified, if anything was.

    What was made again in the same folder is another model.
    """
    if model.card is None and model.folder is not None:
        return content_hash((model.folder / FILE).read_bytes())
    return model.card.weights if model.card else None


def episode_file(out: Path, trial: int) -> Path:
    """Return where the record of an episode is kept."""
    return out / FOLDER / f"{trial:03d}.json"


def run_trial(config: ControlConfig, out: Path, index: int) -> int:
    """Run and record one episode; what a worker does. Returns the index.

    An interrupted episode leaves its record beside, under another name.
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


@lru_cache(maxsize=1)
def prepare(config: ControlConfig) -> tuple[NamedDynamics, AbstractPlanner]:
    """Load what plans, once for a process: nothing compiles twice.

    Raises:
        BadInput: model, planner or world cannot be had, or not for such pushes.
    """
    model = load_dynamics(config.model)
    model.check_fits("robot", TIME_STEP)
    planner = make_planner(config.planner, deadline=config.deadline)
    make_engine(config.world)
    return model, planner


def make_trial(config: ControlConfig, index: int) -> Trial:
    """Draw the world and the goal of one trial; models and planners see the same."""
    rng = np.random.default_rng([_WORLD, config.seed, index])
    true = _scene(MASS, RADIUS, config.disks, float(rng.uniform(*_TABLE_FRICTION)))
    state = _in_a_row(np.asarray(true.radius))
    robot = SimulatedRobot(
        make_engine(config.world),
        true,
        state,
        noise=at_level(NoiseConfig(), config.noise_level),
        rng=rng,
    )
    moved = config.disks - 1
    goal = draw_goal(
        config.goals,
        config.seed,
        index,
        disk=np.asarray(state.position)[moved],
        axis=0.0,
        radius=float(true.radius[moved]),
    )
    task = PushToGoal(
        jnp.asarray(goal, jnp.float32), moved, config.tolerance, config.alignment
    )
    told = (PAPER_MASS, PAPER_RADIUS) if config.knows == "nominal" else (MASS, RADIUS)
    return Trial(robot, task, _scene(*told, config.disks, PAPER_FRICTION))


def _scene(
    mass: tuple[float, ...], radius: tuple[float, ...], disks: int, friction: float
) -> Scene:
    """Return a scene; disks beyond the second have the mean of both."""

    def each(values: tuple[float, ...]) -> jax.Array:
        mean = sum(values) / len(values)
        return jnp.array((*values, *[mean] * disks)[:disks], jnp.float32)

    contact = jnp.float32(CONTACT_FRICTION)
    return Scene(
        mass=each(mass),
        radius=each(radius),
        table_friction=jnp.float32(friction),
        disk_friction=contact,
        pusher_friction=contact,
        pusher_radius=jnp.float32(PUSHER_RADIUS),
    )


def _in_a_row(radius: np.ndarray) -> State:
    """Return disks that touch, along the x axis, the first one at the origin."""
    x = np.concatenate([[0.0], np.cumsum(radius[:-1] + radius[1:])])
    position = jnp.asarray(np.stack([x, 0 * x], axis=-1), jnp.float32)
    behind = jnp.array([-2 * radius[0], 0], jnp.float32)
    return at_rest(position, jnp.zeros(len(radius)), behind)
