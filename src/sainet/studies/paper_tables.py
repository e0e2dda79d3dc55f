"""The paper's tables of prediction errors (Tables I to III), and Table III on planar.

Rows: physics with assumed properties and with true masses and radii, the network alone,
and the network around three engines: Bullet (the paper's SAIN), planar (which plans
fast) and planar with the true masses and radii (for users who have measured the disks).
Table II has the networks a second time, fine-tuned beside a bystander.
"""

from sainet.datasets.config import GenerateConfig
from sainet.evaluation.claims import PUBLISHED_ORDER, Claim, errs_less
from sainet.evaluation.measurements import PublishedValues
from sainet.learning.recipes import PAPER
from sainet.models.identity import ModelId
from sainet.studies.paper_setup import IN, NETWORKS, SAIN, SIZES, PaperSetup, physics
from sainet.studies.steps import Evaluate, Simulate, Train
from sainet.studies.study import Plan, Scope, Study
from sainet.worlds.config import SetupName

BESIDE = NETWORKS  # fine-tuned beside a bystander
TRAININGS = 5  # of each network
# Training pushes, test pushes, iterations, training runs of the table on planar.
_PLANAR_TRAININGS = 3


def errors_of(
    model: ModelId,
    trans: tuple[float, ...],  # %
    pos: tuple[float, ...],  # mm
    rot: tuple[float, ...],  # deg
    *,
    condition: str = "",
) -> PublishedValues:
    """Return the published errors of one model, for each disk."""
    return PublishedValues(
        condition=condition,
        model=model,
        values={"trans_percent": trans, "pos_mm": pos, "rot_deg": rot},
    )


# Of the paper (Ajay et al., ICRA 2019).
_PHYSICS = physics()[0].id
PUBLISHED_DIRECT_FORCE_TWO_DISKS = (
    errors_of(_PHYSICS, (2.82, 2.31), (6.57, 6.05), (0.91, 0.45)),
    errors_of(IN, (2.09, 1.47), (5.61, 3.79), (0.68, 0.26)),
    errors_of(SAIN, (1.62, 1.38), (4.38, 3.34), (0.38, 0.20)),
)
PUBLISHED_DIRECT_FORCE_THREE_DISKS = (
    errors_of(_PHYSICS, (2.79, 2.34, 2.38), (6.53, 6.11, 6.21), (0.89, 0.48, 0.49)),
    errors_of(IN, (2.12, 1.63, 1.67), (5.68, 4.41, 4.52), (0.70, 0.34, 0.38)),
    errors_of(SAIN, (1.68, 1.52, 1.61), (4.54, 3.97, 4.34), (0.41, 0.25, 0.32)),
)
PUBLISHED_ROBOT_TWO_DISKS = (
    errors_of(_PHYSICS, (2.52, 2.19), (6.27, 5.81), (0.85, 0.29)),
    errors_of(IN, (2.13, 1.59), (5.76, 3.84), (0.72, 0.28)),
    errors_of(SAIN, (1.82, 1.50), (4.66, 3.47), (0.40, 0.21)),
)


def _two_disks(setup: SetupName, scope: Scope) -> Plan:
    paper = PaperSetup(setup, scope.scale)
    networks = paper.train(NETWORKS, scope.seeds(TRAININGS))
    return Plan(paper.compare(networks, paper.test_pushes()))


def _three_disks(scope: Scope) -> Plan:
    """Return the steps of Table II: the networks of Table I on scenes of three disks.

    In pushes of two disks no disk stays untouched. Networks that were fine-tuned beside
    a bystander were still trained only on pushes of two disks.
    """
    paper, seeds = PaperSetup("direct-force", scope.scale), scope.seeds(TRAININGS)
    networks = paper.train(NETWORKS, seeds)
    networks += paper.train_beside_bystander(BESIDE, seeds)
    three = paper.test_pushes("test-3-disks", GenerateConfig(disks=3))
    return Plan(
        paper.compare(networks, three), paper.compare(networks, paper.test_pushes())
    )


def _planar(scope: Scope) -> Plan:
    sizes = SIZES[scope.scale]
    train = Simulate("planar-train", GenerateConfig(pushes=sizes.pushes))
    test = Simulate("planar-test", GenerateConfig(pushes=sizes.tests, seed=1))
    recipe = PAPER.changed(iterations=sizes.iterations)
    networks = tuple(
        Train(network, train, recipe.changed(seed=seed))
        for network in (IN, SAIN)
        for seed in scope.seeds(_PLANAR_TRAININGS)
    )
    return Plan(Evaluate((*physics(), *networks), test))


_BULLET = "sain-bullet"  # the paper's SAIN
_CLAIMS = (
    Claim("SAIN around Bullet errs less than Physics", errs_less(_BULLET, "physics")),
    Claim(
        "SAIN around Bullet errs less than Physics with true properties",
        errs_less(_BULLET, "physics-true"),
    ),
    PUBLISHED_ORDER,
)
DIRECT_FORCE_TWO_DISKS = Study(
    question="Table I: on pushes of two disks by a force, does a network around an "
    "engine err less than the engine and than a network without one?",
    plan=lambda scope: _two_disks("direct-force", scope),
    claims=_CLAIMS,
    published=PUBLISHED_DIRECT_FORCE_TWO_DISKS,
)
DIRECT_FORCE_THREE_DISKS = Study(
    question="Table II: do networks trained on two disks predict pushes of three?",
    plan=_three_disks,
    claims=_CLAIMS,
    published=PUBLISHED_DIRECT_FORCE_THREE_DISKS,
)
ROBOT_TWO_DISKS = Study(
    question="Table III: do the results of Table I hold if a robot pushes?",
    plan=lambda scope: _two_disks("robot", scope),
    claims=_CLAIMS,
    published=PUBLISHED_ROBOT_TWO_DISKS,
)
ROBOT_PLANAR = Study(
    question="Table III with the planar engine: are the results the same?",
    plan=_planar,
    needs=(),
    claims=(PUBLISHED_ORDER,),
    published=PUBLISHED_ROBOT_TWO_DISKS,
)
