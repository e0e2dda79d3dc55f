"""Other ways to train the networks of Table III: single steps, other l2, less time."""

import numpy as np
from msgspec import structs

from sainet.evaluation.claims import Claim, errs_less
from sainet.evaluation.margins import errs_at_most_more
from sainet.evaluation.measurements import Condition
from sainet.evaluation.summary import Summary
from sainet.learning.recipes import SingleSteps
from sainet.studies.paper_setup import IN, SAIN, PaperSetup
from sainet.studies.steps import Join
from sainet.studies.study import Choice, Plan, Scope, Study

NETWORKS = (IN, SAIN)
TRAININGS = 3  # of each network
L2 = (1e-3, 1e-4, 1e-6)
_MARGIN = 0.05  # largest upper bound, as a fraction of the error of the paper's recipe


def _recurrent_or_not(scope: Scope) -> Plan:
    """Return networks of whole pushes and of single steps: figure 2d against 2c.

    A network of single steps, and the engine in it, restart at every step: in training
    from the true state, in prediction from the predicted one.
    """
    paper, seeds = PaperSetup("robot", scope.scale), scope.seeds(TRAININGS)
    single = [structs.replace(each, variant="single-steps") for each in NETWORKS]
    recipe = paper.recipe.changed(horizon=SingleSteps())
    networks = paper.train(NETWORKS, seeds) + paper.train(single, seeds, recipe)
    return Plan(paper.compare(networks, paper.test_pushes()))


def _regularisation(scope: Scope) -> Plan:
    """Return networks of each l2, on pushes that are neither trained nor tested on."""
    paper = PaperSetup("robot", scope.scale)
    parts = []
    for l2 in L2:
        networks = paper.train(NETWORKS, range(1), paper.recipe.changed(l2=l2))
        condition = Condition(label=f"l2 {l2:g}", factors={"l2": l2})
        parts.append(paper.compare(networks, paper.validation_pushes(), condition))
    return Plan(Join(tuple(parts)))


def _shorter_training(scope: Scope) -> Plan:
    """Return SAIN by the paper's recipe, and with 31 % of the steps of its pushes.

    Half of the iterations, with a learning rate that falls to zero; in the first half
    of them, pushes end after a quarter of their steps.
    """
    paper, seeds = PaperSetup("robot", scope.scale), scope.seeds(TRAININGS)
    half = max(1, paper.recipe.optimiser.iterations // 2)
    recipe = paper.recipe.changed(
        decay="cosine", iterations=half, short_iterations=half // 2
    )
    shorter = [structs.replace(SAIN, variant="shorter")]
    networks = paper.train((SAIN,), seeds) + paper.train(shorter, seeds, recipe)
    return Plan(paper.compare(networks, paper.test_pushes()))


def choose_l2(summary: Summary) -> tuple[Choice, ...]:
    """Return the score of each l2; the least is the choice."""
    return tuple(
        Choice(l2=float(c.factors["l2"]), score=score(summary, c.label))
        for c in summary.conditions
    )


def score(summary: Summary, where: str = "") -> float:
    """Return the mean error over that of physics, of all networks and disks."""
    over = [
        np.array(summary.errors(network.slug, key, where))
        / np.array(summary.errors("physics", key, where))
        for network in NETWORKS
        for key in ("pos_mm", "rot_deg")
    ]
    return float(np.mean(over))


RECURRENT_OR_NOT = Study(
    question="Is training on whole pushes better than on single steps (figure 2)?",
    plan=_recurrent_or_not,
    claims=tuple(
        Claim(
            f"{kind.upper()} trained on whole pushes errs less than on single steps",
            errs_less(kind, f"{kind}-single-steps"),
        )
        for kind in ("in", "sain")
    ),
)
REGULARISATION = Study(
    question="Which l2 should networks be trained with?",
    plan=_regularisation,
    choose=choose_l2,
)
SHORTER_TRAINING = Study(
    question="Does SAIN reach the errors of the paper's recipe in a third of the time?",
    plan=_shorter_training,
    claims=(
        Claim(
            f"SAIN after the shorter training errs at most {_MARGIN:.0%} more than by "
            "the paper's recipe",
            errs_at_most_more("sain-shorter", "sain", _MARGIN),
            margin=_MARGIN,
        ),
    ),
)
