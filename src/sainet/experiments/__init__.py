"""One module for each table or figure, published numbers beside ours, and the demo."""

from collections.abc import Callable
from importlib import import_module
from typing import Any

from sainet.errors import UnknownName

EXPERIMENTS = {"robot-planar": "sainet.experiments.robot_planar"}


def load_experiment(name: str) -> Callable[..., dict[str, Any]]:
    """Return the function `run` of an experiment.

    Raises:
        UnknownName: no experiment has this name.
    """
    if name not in EXPERIMENTS:
        available = ", ".join(sorted(EXPERIMENTS))
        raise UnknownName(f"No experiment named {name!r}. Available: {available}.")
    return import_module(EXPERIMENTS[name]).run
