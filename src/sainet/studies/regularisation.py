"""Which l2 to train with, chosen on pushes that are neither trained nor tested on."""

import numpy as np

from sainet.evaluation.conditions import Condition
from sainet.evaluation.joining import join
from sainet.evaluation.summary import Summary, summarise
from sainet.learning.recipes import PAPER
from sainet.studies.chain import Chain
from sainet.studies.config import Scale
from sainet.studies.paper_setup import paper_setup
from sainet.studies.result import Choice, Result

CHOICES = (1e-3, 1e-4, 1e-6)
NETWORKS = ("in", "sain")
SEEDS = range(1)


def run(scale: Scale, chain: Chain) -> Result:
    """Train IN and SAIN with each l2 on the robot setup.

    Returns:
        The table, and in `choices` the `score` of each l2: position and rotation
        errors over those of physics, the mean over both, networks and disks. The
        least is the choice.
    """
    setup = paper_setup("robot", scale, chain)
    validation = setup.validation_pushes()
    parts, choices = [], []
    for l2 in CHOICES:
        form = "" if l2 == PAPER.objective.l2 else f"l2-{l2:g}"
        trainings = setup.train(NETWORKS, SEEDS, form=form, l2=l2)
        condition = Condition(label=f"l2 {l2:g}", factors={"l2": l2})
        found = setup.compare(trainings, validation, condition=condition)
        choices.append(Choice(l2=l2, score=score(summarise(found))))
        parts.append(found)
    found = join(parts)
    result = Result(summary=summarise(found), choices=tuple(choices))
    return chain.finish(result, measurements=found)


def score(summary: Summary) -> float:
    """Return the mean error of the networks over that of physics."""
    over = [
        np.array(summary.errors(name, key)) / np.array(summary.errors("physics", key))
        for name in NETWORKS
        for key in ("pos_mm", "rot_deg")
    ]
    return float(np.mean(over))
