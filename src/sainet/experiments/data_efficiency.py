"""How many pushes a network needs, alone and around an engine."""

from typing import Any

from sainet.experiments.chain import Chain
from sainet.experiments.config import Scale
from sainet.experiments.paper_setup import join, paper_setup
from sainet.runs import write_json
from sainet.viz.efficiency import draw_data_efficiency

PUSHES = {"quick": (50, 150, 500), "paper": (50, 150, 500, 1500, 4500)}
SEEDS = {"quick": range(1), "paper": range(3)}
NETWORKS = ("in", "sain")


def run(scale: Scale, chain: Chain) -> dict[str, Any]:
    """Train IN and SAIN on ever more pushes of the robot setup; returns the table.

    Every training has the same number of iterations, however few its pushes are.
    """
    setup = paper_setup("robot", scale, chain)
    tests = setup.test_pushes()
    tables = []
    for pushes in PUSHES[scale]:
        whole = pushes == setup.sizes.pushes
        form = "" if whole else f"{pushes}-pushes"
        trainings = {
            name: setup.train(name, SEEDS[scale], form=form, pushes=pushes)
            for name in NETWORKS
        }
        tables.append(setup.compare(trainings, tests, group=f"{pushes:,}"))
    table = join(tables)
    write_json(chain.out / "table.json", table)
    draw_data_efficiency(table, chain.out / "data-efficiency.svg")
    return table
