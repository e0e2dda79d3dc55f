"""How many pushes a network needs, alone and around an engine."""

from typing import Any

from sainet.experiments.chain import Chain
from sainet.experiments.config import Scale
from sainet.experiments.paper_setup import PaperSetup, join, paper_setup
from sainet.training.config import FitConfig
from sainet.viz.efficiency import draw_data_efficiency

PUSHES = {"quick": (50, 150, 500), "paper": (50, 150, 500, 1500, 4500)}
SEEDS = {"quick": range(1), "paper": range(3)}
NETWORKS = ("in", "sain", "sain-calibrated")
IN_FULL = "all, trained in full"
_SHORTER = 4


def run(scale: Scale, chain: Chain) -> dict[str, Any]:
    """Train IN and SAIN on ever more pushes of the robot setup; returns the table.

    SAIN around the calibrated engine shows how much of the gain is that of the engine:
    all else is the same, its prediction alone is closer to the truth.

    Every size has a quarter of the iterations, so that what differs is the data: at the
    paper's scale that is still 55 passes over 4,500 pushes. The networks of Table III,
    which had all iterations, have a group of their own, outside of the figure.
    """
    setup = paper_setup("robot", scale, chain)
    recipes = {f"{n:,}": _shorter(setup, n) for n in PUSHES[scale]} | {IN_FULL: {}}
    tests = setup.test_pushes()
    tables = [
        setup.compare(setup.train(NETWORKS, SEEDS[scale], **recipe), tests, group=group)
        for group, recipe in recipes.items()
    ]
    draw_data_efficiency(join(tables[:-1]), chain.out / "data-efficiency.svg")
    return chain.finish(join(tables))


def _shorter(setup: PaperSetup, pushes: int) -> dict[str, Any]:
    """Return the settings of a training on few pushes, and what to call it."""
    return {
        "pushes": pushes,
        "form": f"{pushes}-pushes",
        "iterations": max(setup.sizes.iterations // _SHORTER, 1),
        "halve_every": FitConfig.halve_every // _SHORTER,
    }
