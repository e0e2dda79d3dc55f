"""The paper's tables of prediction errors (Tables I to III), with Bullet as the truth.

Rows: physics alone with the paper's properties and calibrated, the network alone, and
the network around three engines: Bullet (the paper's SAIN), planar (which plans fast)
and planar with the true masses and radii (what a user who knows the disks would pick).
Table II has the networks a second time, after they have met a bystander.
"""

from dataclasses import dataclass

import msgspec

from sainet.evaluation.conditions import PublishedValues
from sainet.evaluation.summary import summarise
from sainet.studies.chain import Chain
from sainet.studies.config import Scale
from sainet.studies.paper_setup import BYSTANDER, NETWORKS, paper_setup, with_form
from sainet.studies.published import (
    DIRECT_FORCE_THREE_DISKS,
    DIRECT_FORCE_TWO_DISKS,
    ROBOT_TWO_DISKS,
)
from sainet.studies.result import Result
from sainet.worlds.config import SetupName

TRAINED_DISKS = 2
BESIDE = NETWORKS  # what meets a bystander before it meets three disks
SEEDS = {"quick": range(1), "paper": range(5)}  # trainings of each network


@dataclass(frozen=True)
class PaperTable:
    """One table of the paper: trained on two disks, tested on so many."""

    setup: SetupName
    disks: int
    published: tuple[PublishedValues, ...]


def direct_force_two_disks(scale: Scale, chain: Chain) -> Result:
    """Make Table I again."""
    return make_table(
        PaperTable("direct-force", 2, DIRECT_FORCE_TWO_DISKS), scale, chain
    )


def direct_force_three_disks(scale: Scale, chain: Chain) -> Result:
    """Make Table II again: the networks of Table I on scenes of three disks.

    And networks that went on from them beside a bystander, for in two-disk pushes no
    disk is untouched: still trained on nothing but pushes of two disks.
    """
    return make_table(
        PaperTable("direct-force", 3, DIRECT_FORCE_THREE_DISKS), scale, chain
    )


def robot_two_disks(scale: Scale, chain: Chain) -> Result:
    """Make Table III again."""
    return make_table(PaperTable("robot", 2, ROBOT_TWO_DISKS), scale, chain)


def make_table(table: PaperTable, scale: Scale, chain: Chain) -> Result:
    """Simulate, train and compare.

    Args:
        table: which one.
        scale: `paper` is 4,500 pushes, 500 test pushes and 10,000 iterations.
        chain: does the steps; its folder is the table's, what is shared lies beside it.
    """
    setup = paper_setup(table.setup, scale, chain)
    tests = setup.test_pushes(f"test-{table.disks}-disks", disks=table.disks)
    trainings = setup.train(NETWORKS, SEEDS[scale])
    more_disks = table.disks > TRAINED_DISKS
    if more_disks:
        beside = setup.train_beside_bystander(BESIDE, SEEDS[scale])
        trainings |= {with_form(name, BYSTANDER): beside[name] for name in BESIDE}
    found = setup.compare(trainings, tests).with_published(table.published)
    measured = {"measurements": found}
    result = Result(summary=summarise(found))
    if more_disks:
        found = setup.compare(trainings, setup.test_pushes())
        measured["as_trained"] = found
        result = msgspec.structs.replace(result, as_trained=summarise(found))
    return chain.finish(result, **measured)
