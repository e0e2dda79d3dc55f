"""Time of a step and of a decision, by the number of disks in a row."""

from collections.abc import Sequence

import jax
import numpy as np

from sainet.bench import Figures
from sainet.bench.timing import check_runs, median_seconds
from sainet.control.config import ControlConfig
from sainet.control.trial import make_trial
from sainet.models.library import load_model
from sainet.planning import make_planner
from sainet.planning.levels import judge
from sainet.scenes.pushes import PushGrid, settled_steps

COUNTS = (2, 4, 8, 16)
_STATES = 18  # from each of which every candidate push is predicted
_MODELS = {"engine": "physics-true", "network": "sain-any"}


def bench_disks(runs: int = 5, *, counts: Sequence[int] = COUNTS) -> Figures:
    """Return the cost of more disks, without compilation.

    Args:
        runs: number of measurements, for the median.
        counts: numbers of disks.

    Returns:
        For each number of disks n the time of a scene step of the engine and of the
        contact network around it (µs), `engine_step_us_n` and `network_step_us_n`, and
        that of a decision of the tree planner with this network, `tree_s_n`.
    """
    check_runs(runs)
    figures: dict[str, float | str | None] = {}
    for count in counts:
        figures |= _figures(count, runs)
    return figures | {"devices": jax.device_count(), "runs": runs}


def _figures(count: int, runs: int) -> Figures:
    trial = make_trial(ControlConfig(disks=count), 0)
    one = trial.robot.observe()
    pushes = jax.tree.map(lambda x: np.tile(x, _STATES), PushGrid().pushes())
    rows, steps = len(pushes.length), settled_steps(pushes, trial.scene.time_step)
    states = jax.tree.map(lambda x: np.repeat(np.asarray(x)[None], rows, 0), one)
    found: dict[str, float] = {}
    for name, model in _MODELS.items():
        judged = load_model(model).dynamics, trial.task, trial.scene
        time = median_seconds(lambda j=judged: judge(*j, states, pushes), runs)
        found[f"{name}_step_us_{count}"] = 1e6 * time / (rows * steps)
    planner, dynamics = make_planner("tree"), load_model(_MODELS["network"]).dynamics
    found[f"tree_s_{count}"] = median_seconds(
        lambda: planner.plan(dynamics, trial.task, trial.scene, one).cost, runs
    )
    return found
