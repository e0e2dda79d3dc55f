"""How much work a step is, and how long that takes by what was measured.

The durations of a kind of work grow with its size: a constant (imports, compilation)
and a time for each unit. Both are fitted to recorded durations by `tools/durations.py`.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cache, singledispatch
from importlib.resources import files
from typing import Any

import msgspec

from sainet.runs.workers import core_count
from sainet.scenes.quantities import Finite
from sainet.studies import cross_validation, fine_tuning, simulated_control, steps
from sainet.studies.lab_pushes import Collect
from sainet.studies.steps import Step

RATES = "durations.json"
_DISKS = 2  # of pushes whose number is not known before


@dataclass(frozen=True)
class Effort:
    """Kind and size of the work of a step."""

    kind: str
    size: float = 1.0


class Rate(msgspec.Struct, frozen=True):
    """Seconds of a kind of work: a constant, and for each unit of its size."""

    constant: Finite
    unit: Finite


class Rates(msgspec.Struct, frozen=True, kw_only=True):
    """What durations of steps were measured, on which machine."""

    processor: str
    cores: int
    kinds: dict[str, Rate]


@cache
def measured_rates() -> Rates:
    """Return the rates that ship with the package."""
    found = files("sainet.studies").joinpath(RATES).read_bytes()
    return msgspec.json.decode(found, type=Rates)


def expected_seconds(steps: Iterable[Step[Any]]) -> Mapping[str, float]:
    """Return how long steps are expected to take here, by their keys.

    A machine of twice the cores is expected to take half the time.
    """
    rates, found = measured_rates(), {}
    for step in steps:
        work = effort(step)
        rate = rates.kinds.get(work.kind, Rate(0.0, 0.0))
        seconds = rate.constant + rate.unit * work.size
        found[step.key] = seconds * rates.cores / core_count()
    return found


def _pushes(step: Step[Any]) -> tuple[int, int]:
    """Return the number of pushes of a dataset, at most, and that of disks."""
    match step:
        case steps.Simulate(config=config):
            return config.pushes, config.disks
        case steps.Given(store=store):
            return store.info.pushes, store.info.bodies
        case steps.First(count=count):
            return count, _pushes(step.pushes)[1]
        case Collect(config=config):
            return config.pushes, _DISKS
        case _:
            inner = getattr(step, "pushes", None)
            return _pushes(inner) if isinstance(inner, Step) else (1, _DISKS)


@singledispatch
def effort(step: Step[Any]) -> Effort:
    """Return the work of a step: by default, its kind without a size."""
    return Effort(type(step).__name__)


@effort.register
def _(step: steps.Simulate) -> Effort:
    config = step.config
    engines = (config.engine, *config.assumed_engine)
    slowest = "bullet" if any("bullet" in each for each in engines) else "planar"
    own = [each for each in engines if slowest in each]
    return Effort(f"Simulate {slowest}", config.pushes * len(own) * config.disks)


@effort.register
def _(step: steps.Train) -> Effort:
    way, optimiser = step.recipe.horizon, step.recipe.optimiser
    pushes, disks = _pushes(step.pushes)
    batch = min(optimiser.batch_size, pushes)
    size = optimiser.iterations * batch * way.steps / way.hold * disks
    return Effort(f"Train {way.kind}" + ", held" * (way.hold > 1), size)


@effort.register
def _(step: steps.Evaluate) -> Effort:
    return Effort("Evaluate", len(step.models) * _pushes(step.pushes)[0])


@effort.register
def _(step: simulated_control.RunTrials) -> Effort:
    size = len(step.models) * step.config.trials
    return Effort(f"RunTrials {step.config.planner}", size)


@effort.register(steps.WithBystander)
@effort.register(steps.Identify)
@effort.register(cross_validation.FitEngine)
@effort.register(cross_validation.EvaluateFitted)
@effort.register(fine_tuning.Record)
@effort.register(Collect)
def _(step: Step[Any]) -> Effort:
    return Effort(type(step).__name__, _pushes(step)[0])


@effort.register
def _(step: cross_validation.FitCandidate) -> Effort:
    return Effort(f"Fit {step.candidate.identity.kind}", _pushes(step.engine)[0])
