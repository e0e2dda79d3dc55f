"""How many pushes a network needs, alone and around an engine."""

from typing import Any

from sainet.experiments.chain import Chain
from sainet.experiments.config import Scale
from sainet.experiments.paper_setup import PaperSetup, join, paper_setup
from sainet.runs import write_json
from sainet.training.config import FitConfig
from sainet.viz.efficiency import draw_data_efficiency

PUSHES = {"quick": (50, 150, 500), "paper": (50, 150, 500, 1500, 4500)}
SEEDS = {"quick": range(1), "paper": range(3)}
NETWORKS = ("in", "sain")
_SHORTER = 4


def run(scale: Scale, chain: Chain) -> dict[str, Any]:
    """Train IN and SAIN on ever more pushes of the robot setup; returns the table.

    On fewer pushes than all, a training has a quarter of the iterations: at the paper's
    scale that is still 160 passes over 1,500 pushes.
    """
    setup = paper_setup("robot", scale, chain)
    tests = setup.test_pushes()
    tables = []
    for pushes in PUSHES[scale]:
        whole = pushes == setup.sizes.pushes
        recipe = {} if whole else _shorter(setup, pushes)
        trainings = {
            name: setup.train(name, SEEDS[scale], pushes=pushes, **recipe)
            for name in NETWORKS
        }
        tables.append(setup.compare(trainings, tests, group=f"{pushes:,}"))
    table = join(tables)
    write_json(chain.out / "table.json", table)
    draw_data_efficiency(table, chain.out / "data-efficiency.svg")
    return table


def _shorter(setup: PaperSetup, pushes: int) -> dict[str, Any]:
    """Return the settings of a training on few pushes, and what to call it."""
    return {
        "form": f"{pushes}-pushes",
        "iterations": max(setup.sizes.iterations // _SHORTER, 1),
        "halve_every": FitConfig.halve_every // _SHORTER,
    }
