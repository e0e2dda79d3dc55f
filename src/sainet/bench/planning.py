"""Time of a decision, and time of the same predictions in Bullet."""

import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from time import perf_counter

import jax
import jax.numpy as jnp

from sainet.bench import Figures
from sainet.bench.timing import check_runs, with_cache
from sainet.control.config import ControlConfig
from sainet.control.trial import Trial, make_trial
from sainet.engines import make_engine
from sainet.models.dynamics import PhysicsDynamics
from sainet.models.library import load_model
from sainet.planning import PLANNERS, make_planner
from sainet.planning.base import Plan
from sainet.planning.levels import batch_of, roll_pushes
from sainet.scenes.pushes import PushGrid, settled_steps

DECISIONS = 50
_ROUNDS = 5  # in each, decisions alternate with pushes in Bullet
_PUSHES = 20  # Bullet pushes per round
_FIRST_DECISION = """
import jax
jax.config.update("jax_num_cpu_devices", {devices})
from sainet.bench.planning import decide
decide({model!r})
"""


def bench_planning(
    runs: int = DECISIONS, *, model: str = "sain", starts: bool = True
) -> Figures:
    """Return decision times of both planners, of Bullet, and of new processes.

    Args:
        runs: decisions per planner, for the median.
        model: name of the model that predicts.
        starts: whether to start new processes and time their first decision.

    Returns:
        `full_tree_s`, `greedy_s`, `bullet_ratio`, `cold_start_s`, `warm_start_s`, and
        the sizes of the measurement.
    """
    check_runs(runs)
    # The first decision compiles.
    evaluated = {name: decide(model, name).evaluated for name in PLANNERS}
    times: dict[str, list[float]] = {"tree": [], "greedy": [], "bullet": []}
    for _ in range(_ROUNDS):
        for name in PLANNERS:
            each = range(-(-runs // _ROUNDS))
            times[name] += [_timed(model, name) for _ in each]
        times["bullet"] += _bullet_pushes()
    tree, push = median(times["tree"]), median(times["bullet"] or [0.0])
    cold, warm = _starts(model) if starts else (None, None)
    return {
        "full_tree_s": tree,
        "greedy_s": median(times["greedy"]),
        "evaluated": evaluated["tree"],
        "bullet_push_s": push or None,
        "bullet_ratio": evaluated["tree"] * push / tree or None,
        "cold_start_s": cold,
        "warm_start_s": warm,
        "decisions": len(times["tree"]),
        "devices": jax.device_count(),
    }


def decide(model: str, planner: str = "tree") -> Plan:
    """Return the plan of one decision at the start of a hard trial."""
    trial = _trial()
    dynamics = load_model(model).dynamics
    state = trial.robot.observe()
    return make_planner(planner).plan(dynamics, trial.task, trial.scene, state)


def _trial() -> Trial:
    return make_trial(ControlConfig(goals="hard"), 0)


def _timed(model: str, planner: str) -> float:
    trial, dynamics = _trial(), load_model(model).dynamics
    state, chosen = trial.robot.observe(), make_planner(planner)
    start = perf_counter()
    chosen.plan(dynamics, trial.task, trial.scene, state)
    return perf_counter() - start


def _bullet_pushes() -> list[float]:
    """Return the times of pushes in one Bullet world (s); empty without PyBullet."""
    if not find_spec("pybullet"):
        return []
    trial, physics = _trial(), PhysicsDynamics(make_engine("bullet"))
    scene, state = (
        batch_of(trial.scene, 1),
        jax.tree.map(lambda x: jnp.asarray(x)[None], trial.robot.truth),
    )
    times = []
    for index in range(_PUSHES):
        push = jax.tree.map(lambda x, i=index: x[i][None], PushGrid().pushes())
        start = perf_counter()
        steps = settled_steps(push, scene.time_step)
        jax.block_until_ready(roll_pushes(physics, scene, state, push, steps).states)
        times.append(perf_counter() - start)
    return times


def _starts(model: str) -> tuple[float, float]:
    """Return the times to the first decision (s), without and with compiled code."""
    code = _FIRST_DECISION.format(model=model, devices=jax.device_count())
    with TemporaryDirectory(prefix="sainet-bench-") as folder:
        times = []
        for _ in range(2):
            start = perf_counter()
            command = [sys.executable, "-c", code]
            subprocess.run(command, check=True, env=with_cache(Path(folder)))
            times.append(perf_counter() - start)
    return times[0], times[1]
