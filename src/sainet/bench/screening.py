"""What screening by the engine saves in the tree planner, and what it changes."""

from statistics import median
from time import perf_counter

import equinox as eqx
import jax

from sainet.bench import Figures
from sainet.bench.timing import check_runs
from sainet.control.config import ControlConfig
from sainet.control.trial import make_trial
from sainet.models.dynamics import AbstractDynamics
from sainet.models.library import load_model
from sainet.planning.base import Plan
from sainet.planning.tree import TreePlanner

MODELS = ("sain", "sain-any")
DISKS = (2, 3)
DECISIONS = 5  # of each trial


def bench_screening(
    runs: int = 10, *, models: tuple[str, ...] = MODELS, disks: tuple[int, ...] = DISKS
) -> Figures:
    """Return decision times of the tree planner with and without screening.

    Both plan from the same observations, in trials with easy goals.

    Args:
        runs: number of trials, each with `DECISIONS` decisions.
        models: that predict.
        disks: numbers of disks.

    Returns:
        For each model m and number of disks n the medians `m_n_screened_s` and
        `m_n_unscreened_s`, and `m_n_same_first_push`, the fraction of decisions in
        which both select the same next push; `decisions`, of each.
    """
    check_runs(runs)
    figures: dict[str, float | str | None] = {}
    for model in models:
        dynamics = load_model(model).dynamics
        for count in disks:
            found = _measured(dynamics, count, runs)
            figures |= {f"{model}_{count}_{k}": v for k, v in found.items()}
    return figures | {"decisions": runs * DECISIONS, "devices": jax.device_count()}


def _measured(dynamics: AbstractDynamics, disks: int, runs: int) -> dict[str, float]:
    planners = TreePlanner(), TreePlanner(is_screened=False)
    times: list[list[float]] = []
    same: list[bool] = []
    for index in range(runs):
        trial = make_trial(ControlConfig(disks=disks), index)
        for _ in range(DECISIONS):
            state, plans, took = trial.robot.observe(), list[Plan](), list[float]()
            for planner in planners:
                start = perf_counter()
                plans.append(planner.plan(dynamics, trial.task, trial.scene, state))
                took.append(perf_counter() - start)
            times.append(took)
            same.append(bool(eqx.tree_equal(*(plan.pushes[0] for plan in plans))))
            trial.robot.push(plans[0].pushes[0])
    screened, unscreened = (median(each) for each in zip(*times[1:], strict=True))
    return {
        "screened_s": screened,
        "unscreened_s": unscreened,
        "same_first_push": sum(same) / len(same),
    }
