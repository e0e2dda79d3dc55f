"""One module for each table or figure, published numbers beside ours, and the demo."""

from collections.abc import Callable
from typing import TYPE_CHECKING

from sainet.runs.names import load_named

if TYPE_CHECKING:
    from sainet.studies.result import Result

_TABLES = "sainet.studies.paper_tables"
EXPERIMENTS = {
    "direct-force-two-disks": f"{_TABLES}:direct_force_two_disks",
    "direct-force-three-disks": f"{_TABLES}:direct_force_three_disks",
    "robot-two-disks": f"{_TABLES}:robot_two_disks",
    "data-efficiency": "sainet.studies.data_efficiency:run",
    "recurrent-or-not": "sainet.studies.recurrent_or_not:run",
    "regularisation": "sainet.studies.regularisation:run",
    "robustness": "sainet.studies.robustness:run",
    "simulated-control": "sainet.studies.simulated_control:run",
    "engine-parity": "sainet.studies.engine_parity:run",
    "robot-planar": "sainet.studies.robot_planar:run",
    "fine-tuning": "sainet.studies.fine_tuning:run",
    "recorded-pushes": "sainet.studies.recorded_pushes:run",
    "recorded-data-efficiency": "sainet.studies.recorded_efficiency:run",
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


def load_experiment(name: str) -> Callable[..., "Result"]:
    """Return what makes the table of an experiment, given the scale and a `Chain`.

    Raises:
        UnknownName: no experiment has this name.
    """
    return load_named("experiment", EXPERIMENTS, name)
