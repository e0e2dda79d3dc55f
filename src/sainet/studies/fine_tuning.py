"""Settings of fine-tuning on few pushes, compared on surrogate robots."""

from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import numpy as np

from sainet.datasets.store import Store
from sainet.evaluation.conditions import Condition
from sainet.evaluation.joining import join
from sainet.evaluation.measurements import Measurements
from sainet.evaluation.summary import Summary, summarise
from sainet.learning.recipes import FROM_ENGINE, recipe_for, start_named
from sainet.models.identity import ModelId
from sainet.models.library import load_model
from sainet.studies.chain import Chain
from sainet.studies.config import Scale
from sainet.studies.result import Choice, Result
from sainet.studies.surrogate import ROBOTS, Robot, recordings
from sainet.studies.trainings import scaled

Change = dict[str, Any]

# The defaults, and what else they could be, one thing at a time.
CHANGES: tuple[Change, ...] = (
    {},
    {"features": "place"},
    {"learning_rate": 3e-4},
    {"learning_rate": 3e-3},
    {"iterations": 300, "halve_every": 200},
    {"l2": 1e-4},
    {"l2": 1e-3},
    {"l2": 1e-2},
    {"linear_from": 0.0},
    {"weight_rotation": 1.0},
    {"mirror": False},
    {"average": 0},
    {"hold": 1},
    {"validation_share": 0.2, "patience": 250},
)
WAYS = (("sain-stroke", {}), *product([FROM_ENGINE], CHANGES))
# With few pushes what matters is how far the network may leave the engine.
WAYS_WITH_FEW = tuple(
    product([FROM_ENGINE], ({}, {"l2": 1e-3}, {"l2": 1e-2}, {"l2": 0.1}))
)
_TRAINING, _TESTS = {"quick": 20, "paper": 200}, {"quick": 20, "paper": 300}
_FEW = {"quick": 10, "paper": 25}


def run(scale: Scale, chain: Chain) -> Result:
    """Tune in every way that is considered, for every robot; returns the table.

    Returns:
        The rows of each robot, number of pushes and way, and in `choices` the `scores`
        of each way: position and rotation errors over those of physics, their mean, by
        robot. `score` is the mean over the robots.
    """
    parts: list[Measurements] = []
    choices = []
    tuners = [_tuner(robot, scale, chain) for robot in ROBOTS]
    with_few = [each.with_few() for each in tuners]
    for several, ways in ((tuners, WAYS), (with_few, WAYS_WITH_FEW)):
        for start, change in ways:
            found = {each.robot: each.tune(start, change) for each in several}
            parts += found.values()
            scores = {name: _score(summarise(each)) for name, each in found.items()}
            choices.append(
                Choice(
                    pushes=several[0].training.info.pushes,
                    start=start,
                    change={**change},
                    score=float(np.mean([*scores.values()])),
                    scores=scores,
                )
            )
    found = join(parts)
    result = Result(summary=summarise(found), choices=tuple(choices))
    return chain.finish(result, measurements=found)


@dataclass(frozen=True)
class _Tuner:
    """Tunes on the recordings of one robot."""

    robot: str
    training: Store
    tests: Store
    scale: Scale
    chain: Chain

    def with_few(self) -> "_Tuner":
        """Return a tuner with only the first recordings."""
        return replace(self, training=self.training.first(_FEW[self.scale]))

    def tune(self, start: str, change: Change) -> Measurements:
        """Measure the tests."""
        pushes = self.training.info.pushes
        recipe = recipe_for(start_named(start)).changed(**change)
        way = "-".join([start, *(f"{key}-{value}" for key, value in change.items())])
        name = f"{self.robot}/{pushes}-pushes/{way}"
        recipe = scaled(recipe, self.scale, pushes)
        result = self.chain.train("sain", self.training, recipe, name=name)
        tuned = replace(
            load_model(str(result.folder)), id=ModelId(kind="sain", name="sain-tuned")
        )
        models = [load_model("physics"), tuned]
        found = self.chain.compare(models, self.tests, steps=0)
        factors = {"robot": self.robot, "training_pushes": pushes, "start": start}
        return found.in_condition(Condition(label=name, factors=factors))


def _tuner(robot: Robot, scale: Scale, chain: Chain) -> _Tuner:
    training = recordings(robot, "training", _TRAINING[scale], 0, chain)
    tests = recordings(robot, "tests", _TESTS[scale], 1, chain)
    return _Tuner(robot.name, training, tests, scale, chain)


def _score(summary: Summary) -> float:
    tuned, physics = (
        np.array([summary.errors(m, k) for k in ("final_pos_mm", "final_rot_deg")])
        for m in ("sain-tuned", "physics")
    )
    return float(np.mean(tuned / physics))
