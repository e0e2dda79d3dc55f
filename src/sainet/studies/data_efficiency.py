"""How many pushes a network needs, alone and around an engine."""

from collections.abc import Sequence
from typing import Any

from sainet.learning.recipes import PAPER
from sainet.report.figures.efficiency import draw_data_efficiency
from sainet.studies.chain import Chain
from sainet.studies.config import Scale
from sainet.studies.paper_setup import PaperSetup, join, paper_setup

PUSHES = {"quick": (50, 150, 500), "paper": (50, 150, 500, 1500, 4500)}
SEEDS = {"quick": range(1), "paper": range(3)}
OTHER_SEEDS = {"quick": range(1, 2), "paper": range(3, 8)}
NETWORKS = ("in", "sain")
AGAIN = 500  # pushes, with other seeds
IN_FULL = "all, trained in full"
_SHORTER = 4


def run(scale: Scale, chain: Chain) -> dict[str, Any]:
    """Train IN and SAIN on ever more pushes of the robot setup; returns the table.

    Every size has a quarter of the iterations, so that what differs is the data: at the
    paper's scale that is still 55 passes over 4,500 pushes. The networks of Table III,
    which had all iterations, have a group of their own, outside of the figure. So have
    further trainings on 500 pushes: where every one of the first three was better
    around an engine than alone, and three too few to say so, others can tell.
    """
    setup = paper_setup("robot", scale, chain)
    tests = setup.test_pushes()

    def table(group: str, seeds: Sequence[int], **recipe: Any) -> dict[str, Any]:  # noqa: ANN401
        return setup.compare(setup.train(NETWORKS, seeds, **recipe), tests, group=group)

    sizes = {pushes: _shorter(setup, pushes) for pushes in PUSHES[scale]}
    tables = [table(f"{n:,}", SEEDS[scale], **sizes[n]) for n in sizes]
    draw_data_efficiency(join(tables), chain.out / "data-efficiency.svg")
    tables += [
        table(again(), OTHER_SEEDS[scale], **sizes[AGAIN]),
        table(IN_FULL, SEEDS[scale]),
    ]
    return chain.finish(join(tables))


def again() -> str:
    """Return what the group of further trainings is called."""
    return f"{AGAIN:,}, other trainings"


def _shorter(setup: PaperSetup, pushes: int) -> dict[str, Any]:
    """Return the settings of a training on few pushes, and what to call it."""
    return {
        "pushes": pushes,
        "form": f"{pushes}-pushes",
        "iterations": max(setup.sizes.iterations // _SHORTER, 1),
        "halve_every": PAPER.optimiser.halve_every // _SHORTER,
    }
