"""Which l2 to train with, chosen on pushes that are neither trained nor tested on."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from sainet.learning.recipes import PAPER
from sainet.studies.chain import Chain
from sainet.studies.config import Scale
from sainet.studies.paper_setup import join, paper_setup

CHOICES = (1e-3, 1e-4, 1e-6)
NETWORKS = ("in", "sain")
SEEDS = range(1)


def run(scale: Scale, chain: Chain) -> dict[str, Any]:
    """Train IN and SAIN with each l2 on the robot setup.

    Returns:
        The table, and in `choices` the `score` of each l2: position and rotation
        errors over those of physics, the mean over both, networks and disks. The
        least is the choice.
    """
    setup = paper_setup("robot", scale, chain)
    validation = setup.validation_pushes()
    tables, choices = [], []
    for l2 in CHOICES:
        form = "" if l2 == PAPER.objective.l2 else f"l2-{l2:g}"
        trainings = setup.train(NETWORKS, SEEDS, form=form, l2=l2)
        table = setup.compare(trainings, validation, group=f"l2 {l2:g}")
        choices.append({"l2": l2, "score": score(table)})
        tables.append(table)
    table = join(tables) | {"choices": choices}
    return chain.finish(table)


def score(table: Mapping[str, Any]) -> float:
    """Return the mean error of the networks over that of physics."""
    errors = {
        model: np.array(
            [
                (row["pos_mm"], row["rot_deg"])
                for row in table["rows"]
                if row["model"] == model
            ]
        )
        for model in ("physics", *NETWORKS)
    }
    return float(np.mean([errors[name] / errors["physics"] for name in NETWORKS]))
