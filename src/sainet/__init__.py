"""Simulator-augmented interaction networks: teach an engine what it gets wrong.

The names below are loaded when first used, so that ``import sainet`` costs nothing
and has no side effects.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

_HOMES = {
    "AbstractDynamics": "sainet.models.dynamics",
    "AbstractEngine": "sainet.engines.base",
    "AssumedProperties": "sainet.engines.assumed",
    "FitConfig": "sainet.training.config",
    "ForceControls": "sainet.pushes",
    "GenerateConfig": "sainet.datasets.config",
    "InteractionNetwork": "sainet.models.interaction",
    "PathControls": "sainet.pushes",
    "PlanarEngine": "sainet.engines.planar.engine",
    "Push": "sainet.pushes",
    "PushGrid": "sainet.pushes",
    "Scene": "sainet.scene",
    "State": "sainet.scene",
    "Trajectory": "sainet.scene",
    "evaluate": "sainet.evaluation.evaluate",
    "fit": "sainet.training.fit",
    "generate": "sainet.datasets.generate",
    "load_dynamics": "sainet.models.registry",
    "open_store": "sainet.datasets.store",
    "predict": "sainet.models.dynamics",
}

if TYPE_CHECKING:
    from sainet.datasets.config import GenerateConfig
    from sainet.datasets.generate import generate
    from sainet.datasets.store import open_store
    from sainet.engines.assumed import AssumedProperties
    from sainet.engines.base import AbstractEngine
    from sainet.engines.planar.engine import PlanarEngine
    from sainet.evaluation.evaluate import evaluate
    from sainet.models.dynamics import AbstractDynamics, predict
    from sainet.models.interaction import InteractionNetwork
    from sainet.models.registry import load_dynamics
    from sainet.pushes import ForceControls, PathControls, Push, PushGrid
    from sainet.scene import Scene, State, Trajectory
    from sainet.training.config import FitConfig
    from sainet.training.fit import fit

__all__ = [
    "AbstractDynamics",
    "AbstractEngine",
    "AssumedProperties",
    "FitConfig",
    "ForceControls",
    "GenerateConfig",
    "InteractionNetwork",
    "PathControls",
    "PlanarEngine",
    "Push",
    "PushGrid",
    "Scene",
    "State",
    "Trajectory",
    "evaluate",
    "fit",
    "generate",
    "load_dynamics",
    "open_store",
    "predict",
]


def __getattr__(name: str) -> Any:  # noqa: ANN401
    """Load a public name from its home when it is first asked for."""
    if name not in _HOMES:
        raise AttributeError(f"module 'sainet' has no attribute {name!r}")
    return getattr(import_module(_HOMES[name]), name)
