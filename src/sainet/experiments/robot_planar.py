"""The robot setup with the planar engine as the truth and as the assumed engine.

The paper's Table III has Bullet for both; this is the same table on the base install.
"""

from collections.abc import Callable
from concurrent.futures import Executor
from pathlib import Path
from typing import Any

from sainet.datasets.config import GenerateConfig
from sainet.experiments.chain import Bar, Chain
from sainet.experiments.config import Scale
from sainet.experiments.published import ROBOT_TWO_DISKS, published_rows
from sainet.runs import write_json
from sainet.training.config import FitConfig

_SIZES = {"quick": (1000, 200, 500), "paper": (4500, 500, 10_000)}


def run(
    scale: Scale,
    out: Path,
    *,
    executor: Executor,
    say: Callable[[str], None],
    bar: Bar,
) -> dict[str, Any]:
    """Simulate, train IN and SAIN, and compare them; returns the table.

    Args:
        scale: `paper` is 4,500 pushes, 10,000 iterations and 500 test pushes.
        out: folder; what is finished in it is not made again.
        executor: of the simulation.
        say: told what is being done.
        bar: shows progress.
    """
    chain = Chain(out, executor, say, bar)
    pushes, tests, iterations = _SIZES[scale]
    train = chain.simulate("train", GenerateConfig(pushes=pushes))
    test = chain.simulate("test", GenerateConfig(pushes=tests, seed=1))
    for model in ("sain", "in"):
        chain.train(model, train, FitConfig(iterations=iterations))
    table = chain.compare(chain.models(), test).to_dict()
    table["published"] = published_rows(ROBOT_TWO_DISKS)
    write_json(out / "table.json", table)
    return table
