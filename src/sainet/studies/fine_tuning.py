"""Settings of fine-tuning on few pushes, compared on surrogate robots."""

from collections import defaultdict
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from sainet.datasets.store import Store
from sainet.datasets.surrogate import ROBOTS, Robot, record, simulated_pushes
from sainet.evaluation.measurements import Condition
from sainet.evaluation.summary import Summary
from sainet.learning.recipes import FROM_ENGINE, recipe_for, start_named
from sainet.models.identity import ModelId
from sainet.report.figures.overview import Ranges, draw_ranges
from sainet.studies.paper_setup import physics, scaled
from sainet.studies.runner import Runner
from sainet.studies.steps import Apart, Evaluate, First, Join, Simulate, Step, Train
from sainet.studies.study import Change, Choice, Plan, Scope, Study


@dataclass(frozen=True)
class Way:
    """One way to fine-tune."""

    start: str  # `engine`, or a shipped network
    # To the recipe of such a start.
    change: Change = field(default_factory=Change)


# The defaults, and other settings, one at a time.
WAYS = (
    Way("sain-stroke"),
    Way(FROM_ENGINE),
    Way(FROM_ENGINE, Change(features="place")),
    Way(FROM_ENGINE, Change(learning_rate=3e-4)),
    Way(FROM_ENGINE, Change(learning_rate=3e-3)),
    Way(FROM_ENGINE, Change(iterations=300, halve_every=200)),
    Way(FROM_ENGINE, Change(l2=1e-4)),
    Way(FROM_ENGINE, Change(l2=1e-3)),
    Way(FROM_ENGINE, Change(l2=1e-2)),
    Way(FROM_ENGINE, Change(linear_from=0.0)),
    Way(FROM_ENGINE, Change(weight_rotation=1.0)),
    Way(FROM_ENGINE, Change(mirror=False)),
    Way(FROM_ENGINE, Change(average=0)),
    Way(FROM_ENGINE, Change(hold=1)),
    Way(FROM_ENGINE, Change(validation_share=0.2, patience=250)),
)
# With few pushes the distance of the network from the engine is decisive.
WAYS_WITH_FEW = (
    Way(FROM_ENGINE),
    *(Way(FROM_ENGINE, Change(l2=l2)) for l2 in (1e-3, 1e-2, 0.1)),
)
TRAINING, TESTS = {"quick": 20, "paper": 200}, {"quick": 20, "paper": 300}
TRIED = {"quick": ROBOTS[:1], "paper": ROBOTS}
FEW = {"quick": 10, "paper": 25}
_TUNED = ModelId(kind="sain", name="sain-tuned")


class Record(Apart[Store]):
    """The recorded pushes of a surrogate robot."""

    is_kept = True

    robot: Robot
    pushes: Simulate
    is_test: bool

    @property
    def name(self) -> str:
        """The pushes and the robot."""
        return f"{self.pushes.name}-{self.robot.name}"

    def run(self, runner: Runner) -> Store:
        """Return the dataset, made where that is unfinished."""
        made = runner.result(self.pushes)
        return record(self.robot, made, runner.folder(self), is_test=self.is_test)


def _plan(scope: Scope) -> Plan:
    """Return every way for each robot, then those with few pushes.

    The quick scale has one robot.
    """
    scale = scope.scale
    training = Simulate("training", simulated_pushes(TRAINING[scale], 0))
    tests = Simulate("tests", simulated_pushes(TESTS[scale], 1))
    parts = []
    for count, ways in ((TRAINING[scale], WAYS), (FEW[scale], WAYS_WITH_FEW)):
        for way in ways:
            for robot in TRIED[scale]:
                pushes: Step[Store] = Record(robot, training, is_test=False)
                if count < TRAINING[scale]:
                    pushes = First(pushes, count)
                recipe = recipe_for(start_named(way.start))
                recipe = recipe.changed(**way.change)
                tuned = Train(_TUNED, pushes, scaled(recipe, scale, count))
                parts.append(
                    Evaluate(
                        (physics()[0], tuned),
                        Record(robot, tests, is_test=True),
                        _condition(robot.name, count, way),
                        steps=0,
                    )
                )
    return Plan(Join(tuple(parts)))


def _condition(robot: str, pushes: int, way: Way) -> Condition:
    changes = way.change.items()
    words = "-".join([way.start, *(f"{key}-{value}" for key, value in changes)])
    return Condition(
        label=f"{robot}/{pushes}-pushes/{words}",
        factors={"robot": robot, "training_pushes": pushes, "start": way.start},
    )


def choose(summary: Summary) -> tuple[Choice, ...]:
    """Return the score of each way: errors over those of physics, their mean by robot.

    `score` is the mean over the robots.
    """
    choices = []
    counts = sorted({int(c.factors["training_pushes"]) for c in summary.conditions})
    robots = dict.fromkeys(str(c.factors["robot"]) for c in summary.conditions)
    for count, ways in zip(reversed(counts), (WAYS, WAYS_WITH_FEW), strict=True):
        for way in ways:
            scores = {
                robot: _score(summary, _condition(robot, count, way).label)
                for robot in robots
            }
            choice = Choice(
                pushes=count,
                start=way.start,
                change=way.change,
                score=float(np.mean([*scores.values()])),
                scores=scores,
            )
            choices.append(choice)
    return tuple(choices)


def _score(summary: Summary, where: str) -> float:
    tuned, engine = (
        np.array(
            [summary.errors(m, k, where) for k in ("final_pos_mm", "final_rot_deg")]
        )
        for m in (_TUNED.slug, "physics")
    )
    return float(np.mean(tuned / engine))


def _draw(summary: Summary, path: Path) -> Path:
    """Draw the score of each way, with the range over the robots."""
    rows: Ranges = defaultdict(dict)
    for each in choose(summary):
        way = each.cells["way"].replace("`", "")
        rows[f"{each.pushes} pushes"][way] = [*(each.scores or {}).values()]
    return draw_ranges({"errors over those of physics": rows}, path)


STUDY = Study(
    question="With which settings should networks be fine-tuned on few pushes?",
    plan=_plan,
    needs=(),
    choose=choose,
    figure=_draw,
)
