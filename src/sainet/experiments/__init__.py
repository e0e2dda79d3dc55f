"""One module for each table or figure, published numbers beside ours, and the demo."""

from collections.abc import Callable
from typing import Any

from sainet.names import load_named

_TABLES = "sainet.experiments.paper_tables"
EXPERIMENTS = {
    "direct-force-two-disks": f"{_TABLES}:direct_force_two_disks",
    "direct-force-three-disks": f"{_TABLES}:direct_force_three_disks",
    "robot-two-disks": f"{_TABLES}:robot_two_disks",
    "data-efficiency": "sainet.experiments.data_efficiency:run",
    "recurrent-or-not": "sainet.experiments.recurrent_or_not:run",
    "regularisation": "sainet.experiments.regularisation:run",
    "robustness": "sainet.experiments.robustness:run",
    "simulated-control": "sainet.experiments.simulated_control:run",
    "engine-parity": "sainet.experiments.engine_parity:run",
    "robot-planar": "sainet.experiments.robot_planar:run",
    "fine-tuning": "sainet.experiments.fine_tuning:run",
    "recorded-pushes": "sainet.experiments.recorded_pushes:run",
    "recorded-data-efficiency": "sainet.experiments.recorded_efficiency:run",
}
# What the others need beyond the base install.
_ON_BASE_INSTALL = ("robot-planar", "fine-tuning")
_RECORDED = ("recorded-pushes", "recorded-data-efficiency")


def needs_recorded(name: str) -> bool:
    """Return whether an experiment needs recorded pushes."""
    return name in _RECORDED


def needs_bullet(name: str) -> bool:
    """Return whether an experiment needs PyBullet."""
    return name not in (*_ON_BASE_INSTALL, *_RECORDED)


def load_experiment(name: str) -> Callable[..., dict[str, Any]]:
    """Return what makes the table of an experiment, given the scale and a `Chain`.

    Raises:
        UnknownName: no experiment has this name.
    """
    return load_named("experiment", EXPERIMENTS, name)
