"""The robot setup with the planar engine as the truth and as the assumed engine.

The paper's Table III has Bullet for both; this is the same table on the base install.
"""

from sainet.datasets.config import GenerateConfig
from sainet.evaluation.summary import summarise
from sainet.learning.recipes import PAPER, ModelKind
from sainet.studies.chain import Chain
from sainet.studies.config import Scale
from sainet.studies.published import ROBOT_TWO_DISKS
from sainet.studies.result import Result
from sainet.studies.trainings import Training

_SIZES = {"quick": (1000, 200, 500), "paper": (4500, 500, 10_000)}
_SEEDS = {"quick": (0,), "paper": (0, 1, 2)}
_MODELS: tuple[ModelKind, ...] = ("in", "sain")


def run(scale: Scale, chain: Chain) -> Result:
    """Simulate, train IN and SAIN, and compare them; returns the table.

    Args:
        scale: `paper` is 4,500 pushes, 500 test pushes, and three trainings of each
            network with 10,000 iterations.
        chain: does the steps; what is finished in its folder is not made again.
    """
    pushes, tests, iterations = _SIZES[scale]
    train = chain.simulate("train", GenerateConfig(pushes=pushes))
    test = chain.simulate("test", GenerateConfig(pushes=tests, seed=1))
    recipe = PAPER.changed(iterations=iterations)
    trainings = {
        str(model): Training(model, train, recipe, chain.out / model)
        for model in _MODELS
    }
    made = chain.train_seeds(trainings, _SEEDS[scale])
    found = chain.compare_trainings(made, test).with_published(ROBOT_TWO_DISKS)
    return chain.finish(Result(summary=summarise(found)), measurements=found)
