"""Pushes per second of the vector environment, and of Bullet's world in processes."""

from functools import partial
from importlib.util import find_spec
from statistics import median
from time import perf_counter
from typing import TYPE_CHECKING, Any

from sainet.bench import Figures
from sainet.bench.timing import check_runs
from sainet.runs.workers import core_count

if TYPE_CHECKING:
    from gymnasium.vector import VectorEnv

WORLDS = 1024
_STEPS = 20  # of each process in a measurement
_MISSING = "needs Gymnasium and PyBullet: pip install 'sainet[gym,bullet]'"


def bench_environments(runs: int = 5, *, worlds: int = WORLDS) -> Figures:
    """Return the speed of `sainet/PushDisks-v0`, without compilation and resets.

    Args:
        runs: number of measurements, for the median; each of both, in turn.
        worlds: number of planar worlds, pushed in one call.

    Returns:
        `vector_pushes_per_s`, `bullet_pushes_per_s` of as many processes as there are
        cores, their ratio `bullet_ratio` (None without Gymnasium or PyBullet, with the
        `reason`), and the sizes of the measurement.
    """
    check_runs(runs)
    known = {"worlds": worlds, "processes": core_count(), "runs": runs}
    names = ("vector_pushes_per_s", "bullet_pushes_per_s", "bullet_ratio")
    if not (find_spec("gymnasium") and find_spec("pybullet")):
        return dict.fromkeys(names) | known | {"reason": _MISSING}
    found = _measured(runs, worlds)
    ratios = [vector / bullet for vector, bullet in found]
    medians = [median(values) for values in (*zip(*found, strict=True), ratios)]
    return dict(zip(names, medians, strict=True)) | known | {"reason": None}


def _measured(runs: int, worlds: int) -> list[tuple[float, float]]:
    """Return the pushes per second of both, of each measurement."""
    import gymnasium  # an optional package

    from sainet.control.gym.environment import PushDisks
    from sainet.control.gym.vector import PushDisksVector

    many = PushDisksVector(worlds)
    one = partial(PushDisks, world="bullet")
    processes = gymnasium.vector.AsyncVectorEnv([one] * core_count(), context="spawn")
    try:
        for each in (many, processes):  # compiles, and starts the processes
            _rate(each, 1)
        return [(_rate(many, 1), _rate(processes, _STEPS)) for _ in range(runs)]
    finally:
        processes.close()


def _rate(environments: "VectorEnv[Any, Any, Any]", steps: int) -> float:
    """Return the pushes per second of environments after a reset."""
    environments.reset(seed=0)
    environments.action_space.seed(0)
    actions = environments.action_space.sample()
    start = perf_counter()
    for _ in range(steps):
        environments.step(actions)
    return steps * environments.num_envs / (perf_counter() - start)
