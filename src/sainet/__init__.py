"""Simulator-augmented interaction networks for planar pushing.

The names below are loaded when first used, so that ``import sainet`` costs nothing
and has no side effects.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

_HOMES = {
    "AbstractDynamics": "sainet.models.dynamics",
    "AbstractEngine": "sainet.engines.base",
    "AssumedProperties": "sainet.engines.base",
    "ControlConfig": "sainet.control.config",
    "ForceControls": "sainet.scenes.controls",
    "GenerateConfig": "sainet.datasets.config",
    "InteractionNetwork": "sainet.models.correctors.interaction",
    "Model": "sainet.models.library",
    "ModelId": "sainet.models.identity",
    "PathControls": "sainet.scenes.controls",
    "PlanarEngine": "sainet.engines.planar.engine",
    "Push": "sainet.scenes.pushes",
    "PushGrid": "sainet.scenes.pushes",
    "Recipe": "sainet.learning.recipes",
    "Scene": "sainet.scenes.scene",
    "State": "sainet.scenes.state",
    "Trajectory": "sainet.scenes.state",
    "at_rest": "sainet.scenes.state",
    "evaluate": "sainet.evaluation.evaluate",
    "fit": "sainet.learning.fit",
    "generate": "sainet.datasets.generate",
    "identify": "sainet.identification.identify",
    "load_model": "sainet.models.library",
    "make_engine": "sainet.engines",
    "make_planner": "sainet.planning",
    "open_store": "sainet.datasets.store",
    "predict": "sainet.models.dynamics",
    "recipe_for": "sainet.learning.recipes",
    "run_episode": "sainet.control.episode",
    "run_trials": "sainet.control.trials",
}

if TYPE_CHECKING:
    from sainet.control.config import ControlConfig
    from sainet.control.episode import run_episode
    from sainet.control.trials import run_trials
    from sainet.datasets.config import GenerateConfig
    from sainet.datasets.generate import generate
    from sainet.datasets.store import open_store
    from sainet.engines import make_engine
    from sainet.engines.base import AbstractEngine, AssumedProperties
    from sainet.engines.planar.engine import PlanarEngine
    from sainet.evaluation.evaluate import evaluate
    from sainet.identification.identify import identify
    from sainet.learning.fit import fit
    from sainet.learning.recipes import Recipe, recipe_for
    from sainet.models.correctors.interaction import InteractionNetwork
    from sainet.models.dynamics import AbstractDynamics, predict
    from sainet.models.identity import ModelId
    from sainet.models.library import Model, load_model
    from sainet.planning import make_planner
    from sainet.scenes.controls import ForceControls, PathControls
    from sainet.scenes.pushes import Push, PushGrid
    from sainet.scenes.scene import Scene
    from sainet.scenes.state import State, Trajectory, at_rest

__all__ = [
    "AbstractDynamics",
    "AbstractEngine",
    "AssumedProperties",
    "ControlConfig",
    "ForceControls",
    "GenerateConfig",
    "InteractionNetwork",
    "Model",
    "ModelId",
    "PathControls",
    "PlanarEngine",
    "Push",
    "PushGrid",
    "Recipe",
    "Scene",
    "State",
    "Trajectory",
    "at_rest",
    "evaluate",
    "fit",
    "generate",
    "identify",
    "load_model",
    "make_engine",
    "make_planner",
    "open_store",
    "predict",
    "recipe_for",
    "run_episode",
    "run_trials",
]


def __getattr__(name: str) -> Any:  # noqa: ANN401
    """Load a public name from its home when it is first asked for."""
    if name not in _HOMES:
        raise AttributeError(f"module 'sainet' has no attribute {name!r}")
    return getattr(import_module(_HOMES[name]), name)
