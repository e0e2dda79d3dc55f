"""The paper's tables of prediction errors (Tables I to III), with Bullet as the truth.

Rows: physics alone with the paper's properties and calibrated, the network alone, and
the network around three engines: Bullet (the paper's SAIN), planar (which plans fast)
and planar with the true masses and radii (what a user who knows the disks would pick).
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from sainet.datasets.config import GenerateConfig, Setup
from sainet.experiments.chain import Chain
from sainet.experiments.config import Scale
from sainet.experiments.published import (
    DIRECT_FORCE_THREE_DISKS,
    DIRECT_FORCE_TWO_DISKS,
    ROBOT_TWO_DISKS,
    published_rows,
)
from sainet.runs import write_json
from sainet.training.config import FitConfig

AROUND = {
    "sain-bullet": "bullet",
    "sain": "planar",
    "sain-calibrated": "planar-calibrated",
}
_SIZES = {"quick": (500, 100, 300), "paper": (4500, 500, 10_000)}
_TEST_SEED = 1
_CHUNK = 250  # pushes


@dataclass(frozen=True)
class PaperTable:
    """One table of the paper: trained on two disks, tested on so many."""

    setup: Setup
    disks: int
    published: Mapping[str, Any]
    seeds: int  # trainings of each network at paper scale


def direct_force_two_disks(scale: Scale, chain: Chain) -> dict[str, Any]:
    """Make Table I again."""
    table = PaperTable("direct-force", 2, DIRECT_FORCE_TWO_DISKS, seeds=5)
    return make_table(table, scale, chain)


def direct_force_three_disks(scale: Scale, chain: Chain) -> dict[str, Any]:
    """Make Table II again: the networks of Table I on scenes of three disks."""
    table = PaperTable("direct-force", 3, DIRECT_FORCE_THREE_DISKS, seeds=5)
    return make_table(table, scale, chain)


def robot_two_disks(scale: Scale, chain: Chain) -> dict[str, Any]:
    """Make Table III again."""
    table = PaperTable("robot", 2, ROBOT_TWO_DISKS, seeds=5)
    return make_table(table, scale, chain)


def make_table(table: PaperTable, scale: Scale, chain: Chain) -> dict[str, Any]:
    """Simulate, train and compare; tables of one setup share data and networks.

    Args:
        table: which one.
        scale: `paper` is 4,500 pushes, 500 test pushes and 10,000 iterations.
        chain: does the steps; its folder is the table's, what is shared lies beside it.
    """
    out = chain.out
    chain = replace(chain, out=out.parent / f"{table.setup}-{scale}")
    pushes, tests, iterations = _SIZES[scale]
    around = tuple(AROUND.values())
    train = chain.simulate(
        "train",
        GenerateConfig(
            setup=table.setup,
            pushes=pushes,
            engine="bullet",
            assumed_engine=around,
            chunk_size=min(_CHUNK, pushes),  # whole chunks are simulated
        ),
    )
    test = chain.simulate(
        f"test-{table.disks}-disks",
        GenerateConfig(
            setup=table.setup,
            disks=table.disks,
            pushes=tests,
            engine="bullet",
            seed=_TEST_SEED,
            chunk_size=min(_CHUNK, tests),
        ),
    )
    config = FitConfig(iterations=iterations, batch_size=min(100, pushes))
    seeds = range(table.seeds if scale == "paper" else 1)
    trainings = {"in": chain.train_several("in", train, config, seeds)}
    for name, engine in AROUND.items():
        trainings[name] = chain.train_several(
            "sain", train, config, seeds, name=name, assumed_engine=engine
        )
    result = chain.compare_trainings(trainings, test, engine="bullet").to_dict()
    result["published"] = published_rows(table.published)
    write_json(out / "table.json", result)
    return result
