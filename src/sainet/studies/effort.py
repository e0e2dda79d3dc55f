"""How much work a step is, and how long that takes by what was measured.

The durations of a kind of work grow with its size: a constant (imports, compilation)
and a time for each unit. Both are fitted to recorded durations by `tools/durations.py`.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cache, singledispatch
from importlib.resources import files
from statistics import fmean
from typing import Any, NamedTuple

import msgspec

from sainet.runs.workers import core_count
from sainet.scenes.quantities import Finite
from sainet.scenes.scene import TIME_STEP
from sainet.studies import cross_validation, fine_tuning, simulated_control, steps
from sainet.studies.lab_pushes import Collect
from sainet.studies.paper_setup import WithBystander
from sainet.studies.steps import Step

RATES = "durations.json"
_USUAL_PUSHES = 20  # of an episode that may have more


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

    def seconds(self, work: Effort) -> float:
        """Return how long a step is expected to take on that machine."""
        rate = self.kinds.get(work.kind, Rate(0.0, 0.0))
        return rate.constant + rate.unit * work.size


@cache
def measured_rates() -> Rates:
    """Return the rates that ship with the package."""
    found = files("sainet.studies").joinpath(RATES).read_bytes()
    return msgspec.json.decode(found, type=Rates)


def expected_seconds(steps: Iterable[Step[Any]]) -> Mapping[str, float]:
    """Return how long steps are expected to take here, by their keys.

    A machine of twice the cores is expected to take half the time.
    """
    known = measured_rates()
    pace = known.cores / core_count()
    return {step.key: known.seconds(effort(step)) * pace for step in steps}


class _Extent(NamedTuple):
    """Size of a dataset, at most, as far as it is known before."""

    pushes: int = 1
    disks: int = 2
    steps: int = 1_000  # of a push


def _extent(step: Step[Any]) -> _Extent:
    match step:
        case steps.Simulate(config=config):
            way = config.stroke_mm[-1] / config.speed_mm_s[0] / TIME_STEP
            is_path = config.setup == "robot"
            length = round(way) + config.hold_steps if is_path else config.force_steps
            return _Extent(config.pushes, config.disks, length)
        case steps.Given(store=store):
            info = store.info
            return _Extent(info.pushes, info.bodies, info.steps)
        case steps.First(count=count):
            return _extent(step.pushes)._replace(pushes=count)
        case Collect(config=config):
            return _Extent(config.pushes)
        case _:
            inner = getattr(step, "pushes", None)
            return _extent(inner) if isinstance(inner, Step) else _Extent()


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
    pushes = _extent(step.pushes)
    # A mixture takes its batches in turn from datasets of several numbers of disks.
    every = step.pushes, *getattr(step, "more", ())
    disks = fmean(_extent(each).disks for each in every)
    size = optimiser.iterations * min(optimiser.batch_size, pushes.pushes)
    size *= min(way.steps, pushes.steps) / way.hold * disks
    more = ", held" if way.hold > 1 else ", contact" * (step.id.features == "contact")
    return Effort(f"Train {way.kind}{more}" + ", one disk" * (disks == 1), size)


@effort.register
def _(step: steps.Evaluate) -> Effort:
    return Effort("Evaluate", len(step.models) * _extent(step.pushes).pushes)


@effort.register
def _(step: simulated_control.RunTrials) -> Effort:
    config = step.config
    decisions = len(step.models) * config.trials * min(config.pushes, _USUAL_PUSHES)
    return Effort(f"RunTrials {config.planner}", decisions * config.disks**2)


@effort.register(WithBystander)
@effort.register(steps.Identify)
@effort.register(cross_validation.FitEngine)
@effort.register(cross_validation.EvaluateFitted)
@effort.register(fine_tuning.Record)
@effort.register(Collect)
def _(step: Step[Any]) -> Effort:
    return Effort(type(step).__name__, _extent(step).pushes)


@effort.register
def _(step: cross_validation.FitCandidate) -> Effort:
    identity, pushes = step.candidate.identity, _extent(step.engine).pushes
    words = filter(None, ("Fit", identity.kind, identity.data, identity.variant))
    return Effort(" ".join(words), pushes)
