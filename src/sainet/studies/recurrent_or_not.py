"""Trained on whole pushes or on single steps: the paper's figure 2d against 2c.

A network of single steps, and the engine in it, restart at every step: in training
from the true state, in prediction from the predicted one.
"""

from sainet.evaluation.summary import summarise
from sainet.learning.recipes import SingleSteps
from sainet.studies.chain import Chain
from sainet.studies.config import Scale
from sainet.studies.paper_setup import paper_setup, with_form
from sainet.studies.result import Result

SEEDS = {"quick": range(1), "paper": range(3)}
NETWORKS = ("in", "sain")
SINGLE = "single-steps"


def run(scale: Scale, chain: Chain) -> Result:
    """Train IN and SAIN both ways on the robot setup; returns the table."""
    setup = paper_setup("robot", scale, chain)
    trainings = setup.train(NETWORKS, SEEDS[scale])
    single = setup.train(NETWORKS, SEEDS[scale], form=SINGLE, horizon=SingleSteps())
    trainings |= {with_form(name, SINGLE): single[name] for name in NETWORKS}
    found = setup.compare(trainings, setup.test_pushes())
    return chain.finish(Result(summary=summarise(found)), measurements=found)
