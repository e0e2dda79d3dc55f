"""One module for each table or figure, published numbers beside ours, and the demo."""

from collections.abc import Callable
from typing import Any

from sainet.names import load_named

EXPERIMENTS = {
    "engine-parity": "sainet.experiments.engine_parity:run",
    "robot-planar": "sainet.experiments.robot_planar:run",
}


def load_experiment(name: str) -> Callable[..., dict[str, Any]]:
    """Return the function `run` of an experiment.

    Raises:
        UnknownName: no experiment has this name.
    """
    return load_named("experiment", EXPERIMENTS, name)
