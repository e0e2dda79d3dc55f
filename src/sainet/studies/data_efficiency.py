"""How many pushes a network needs, alone and around an engine."""

from collections.abc import Sequence
from typing import Any

from sainet.evaluation.conditions import Condition
from sainet.evaluation.joining import join
from sainet.evaluation.measurements import Measurements
from sainet.evaluation.summary import summarise
from sainet.learning.recipes import PAPER
from sainet.report.figures.efficiency import draw_data_efficiency
from sainet.studies.chain import Chain
from sainet.studies.config import Scale
from sainet.studies.paper_setup import PaperSetup, paper_setup
from sainet.studies.result import Result

PUSHES = {"quick": (50, 150, 500), "paper": (50, 150, 500, 1500, 4500)}
SEEDS = {"quick": range(1), "paper": range(3)}
OTHER_SEEDS = {"quick": range(1, 2), "paper": range(3, 8)}
NETWORKS = ("in", "sain")
AGAIN = 500  # pushes, with other seeds
AGAIN_CONDITION = Condition(
    label=f"{AGAIN:,}, other trainings",
    factors={"training_pushes": AGAIN, "seeds": "other"},
)
IN_FULL = Condition(
    label="all, trained in full",
    factors={"training_pushes": 4500, "iterations": "all"},
)
_SHORTER = 4


def run(scale: Scale, chain: Chain) -> Result:
    """Train IN and SAIN on ever more pushes of the robot setup; returns the table.

    Every size has a quarter of the iterations, so that what differs is the data: at the
    paper's scale that is still 55 passes over 4,500 pushes. The networks of Table III,
    which had all iterations, have a group of their own, outside of the figure. So have
    further trainings on 500 pushes: where every one of the first three was better
    around an engine than alone, and three too few to say so, others can tell.
    """
    setup = paper_setup("robot", scale, chain)
    tests = setup.test_pushes()

    def measure(
        condition: Condition,
        seeds: Sequence[int],
        **recipe: Any,  # noqa: ANN401
    ) -> Measurements:
        trainings = setup.train(NETWORKS, seeds, **recipe)
        return setup.compare(trainings, tests, condition=condition)

    sizes = {pushes: _shorter(setup, pushes) for pushes in PUSHES[scale]}
    parts = [measure(of_pushes(n), SEEDS[scale], **sizes[n]) for n in sizes]
    parts += [
        measure(AGAIN_CONDITION, OTHER_SEEDS[scale], **sizes[AGAIN]),
        measure(IN_FULL, SEEDS[scale]),
    ]
    found = join(parts)
    summary = summarise(found)
    draw_data_efficiency(summary, chain.out / "data-efficiency.svg")
    return chain.finish(Result(summary=summary), measurements=found)


def of_pushes(count: int) -> Condition:
    """Return the condition of a number of training pushes."""
    return Condition(label=f"{count:,}", factors={"training_pushes": count})


def _shorter(setup: PaperSetup, pushes: int) -> dict[str, Any]:
    """Return the settings of a training on few pushes, and what to call it."""
    return {
        "pushes": pushes,
        "form": f"{pushes}-pushes",
        "iterations": max(setup.sizes.iterations // _SHORTER, 1),
        "halve_every": PAPER.optimiser.halve_every // _SHORTER,
    }
