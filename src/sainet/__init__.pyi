"""The public names and their homes, for type checkers and for `__init__.py`."""

from sainet.control.config import ControlConfig as ControlConfig
from sainet.control.episode import run_episode as run_episode
from sainet.control.gym.policy import GreedyPlanner as GreedyPlanner
from sainet.control.gym.policy import TreePlanner as TreePlanner
from sainet.control.trials import run_trials as run_trials
from sainet.datasets.config import GenerateConfig as GenerateConfig
from sainet.datasets.generate import generate as generate
from sainet.datasets.store import open_store as open_store
from sainet.engines import make_engine as make_engine
from sainet.engines.base import (
    AbstractEngine as AbstractEngine,
)
from sainet.engines.base import (
    AssumedProperties as AssumedProperties,
)
from sainet.engines.planar.engine import PlanarEngine as PlanarEngine
from sainet.evaluation.evaluate import evaluate as evaluate
from sainet.identification.identify import identify as identify
from sainet.learning.fit import fit as fit
from sainet.learning.recipes import Recipe as Recipe
from sainet.learning.recipes import recipe_for as recipe_for
from sainet.models.correctors.interaction import (
    InteractionNetwork as InteractionNetwork,
)
from sainet.models.dynamics import (
    AbstractDynamics as AbstractDynamics,
)
from sainet.models.dynamics import (
    predict as predict,
)
from sainet.models.identity import ModelId as ModelId
from sainet.models.library import Model as Model
from sainet.models.library import load_model as load_model
from sainet.planning import make_planner as make_planner
from sainet.scenes.controls import (
    ForceControls as ForceControls,
)
from sainet.scenes.controls import (
    PathControls as PathControls,
)
from sainet.scenes.pushes import Push as Push
from sainet.scenes.pushes import PushGrid as PushGrid
from sainet.scenes.scene import Scene as Scene
from sainet.scenes.state import (
    State as State,
)
from sainet.scenes.state import (
    Trajectory as Trajectory,
)
from sainet.scenes.state import (
    at_rest as at_rest,
)

__version__: str
