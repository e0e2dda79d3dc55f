"""The paper's tables of prediction errors (Tables I to III), and Table III on planar.

Rows: physics with assumed properties and with true masses and radii, the network alone,
and the network around three engines: Bullet (the paper's SAIN), planar (which plans
fast) and planar with the true masses and radii (for users who have measured the disks).
Table II has the networks a second time, fine-tuned beside a bystander.
"""

from sainet.datasets.config import GenerateConfig
from sainet.evaluation.claims import PUBLISHED_ORDER
from sainet.learning.recipes import PAPER
from sainet.studies.paper_setup import IN, NETWORKS, SAIN, PaperSetup, physics
from sainet.studies.published import (
    PUBLISHED_DIRECT_FORCE_THREE_DISKS,
    PUBLISHED_DIRECT_FORCE_TWO_DISKS,
    PUBLISHED_ROBOT_TWO_DISKS,
)
from sainet.studies.steps import Evaluate, Simulate, Train
from sainet.studies.study import Plan, Scope, Study
from sainet.worlds.config import SetupName

BESIDE = NETWORKS  # fine-tuned beside a bystander
SEEDS = {"quick": range(1), "paper": range(5)}  # training runs of each network
# Training pushes, test pushes, iterations, training runs of the table on planar.
_PLANAR_SIZES = {"quick": (1000, 200, 500, 1), "paper": (4500, 500, 10_000, 3)}


def _two_disks(setup: SetupName, scope: Scope) -> Plan:
    paper = PaperSetup(setup, scope.scale)
    networks = paper.train(NETWORKS, SEEDS[scope.scale])
    return Plan(paper.compare(networks, paper.test_pushes()))


def _three_disks(scope: Scope) -> Plan:
    """Return the steps of Table II: the networks of Table I on scenes of three disks.

    In pushes of two disks no disk stays untouched. Networks that were fine-tuned beside
    a bystander were still trained only on pushes of two disks.
    """
    paper, seeds = PaperSetup("direct-force", scope.scale), SEEDS[scope.scale]
    networks = paper.train(NETWORKS, seeds)
    networks += paper.train_beside_bystander(BESIDE, seeds)
    three = paper.test_pushes("test-3-disks", GenerateConfig(disks=3))
    return Plan(
        paper.compare(networks, three), paper.compare(networks, paper.test_pushes())
    )


def _planar(scope: Scope) -> Plan:
    pushes, tests, iterations, runs = _PLANAR_SIZES[scope.scale]
    train = Simulate("planar-train", GenerateConfig(pushes=pushes))
    test = Simulate("planar-test", GenerateConfig(pushes=tests, seed=1))
    recipe = PAPER.changed(iterations=iterations)
    networks = tuple(
        Train(network, train, recipe.changed(seed=seed))
        for network in (IN, SAIN)
        for seed in range(runs)
    )
    return Plan(Evaluate((*physics(), *networks), test))


DIRECT_FORCE_TWO_DISKS = Study(
    question="Table I: does a network around an engine err less than either, on "
    "pushes of two disks by a force?",
    plan=lambda scope: _two_disks("direct-force", scope),
    published=PUBLISHED_DIRECT_FORCE_TWO_DISKS,
    claims=(PUBLISHED_ORDER,),
)
DIRECT_FORCE_THREE_DISKS = Study(
    question="Table II: do networks trained on two disks predict three?",
    plan=_three_disks,
    published=PUBLISHED_DIRECT_FORCE_THREE_DISKS,
    claims=(PUBLISHED_ORDER,),
)
ROBOT_TWO_DISKS = Study(
    question="Table III: the same as Table I on pushes by a robot?",
    plan=lambda scope: _two_disks("robot", scope),
    published=PUBLISHED_ROBOT_TWO_DISKS,
    claims=(PUBLISHED_ORDER,),
)
ROBOT_PLANAR = Study(
    question="Table III with the planar engine as truth, on the base installation?",
    plan=_planar,
    needs=(),
    published=PUBLISHED_ROBOT_TWO_DISKS,
    claims=(PUBLISHED_ORDER,),
)
