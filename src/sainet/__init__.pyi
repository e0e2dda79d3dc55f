"""The public names and their homes, for type checkers and for `__init__.py`."""

from sainet.api.abstention import abstaining as abstaining
from sainet.api.benchmark import Entry as Entry
from sainet.api.benchmark import Track as Track
from sainet.api.benchmark import score as score
from sainet.api.benchmark import track as track
from sainet.api.engines import from_step as from_step
from sainet.api.evaluating import evaluate as evaluate
from sainet.api.functions import from_function as from_function
from sainet.api.learning import identify as identify
from sainet.api.learning import tune as tune
from sainet.api.mjcf import from_mjcf as from_mjcf
from sainet.api.models import load as load
from sainet.api.predictions import from_predictions as from_predictions
from sainet.api.pushes import Pushes as Pushes
from sainet.api.pushes import generate as generate
from sainet.api.pushes import open_pushes as open_pushes
from sainet.api.table import ErrorTable as ErrorTable
from sainet.api.validation import CrossValidation as CrossValidation
from sainet.api.validation import cross_validate as cross_validate
from sainet.control.config import ControlConfig as ControlConfig
from sainet.control.episode import run_episode as run_episode
from sainet.control.gym.policy import GreedyPlanner as GreedyPlanner
from sainet.control.gym.policy import TreePlanner as TreePlanner
from sainet.control.trials import run_trials as run_trials
from sainet.datasets.config import GenerateConfig as GenerateConfig
from sainet.datasets.store import open_store as open_store
from sainet.engines import make_engine as make_engine
from sainet.engines.base import AbstractEngine as AbstractEngine
from sainet.engines.base import AssumedProperties as AssumedProperties
from sainet.engines.planar.engine import PlanarEngine as PlanarEngine
from sainet.identification.adaptation import Adaptation as Adaptation
from sainet.learning.fit import fit as fit
from sainet.learning.recipes import FromModel as FromModel
from sainet.learning.recipes import FromSimulator as FromSimulator
from sainet.learning.recipes import Recipe as Recipe
from sainet.learning.recipes import recipe_for as recipe_for
from sainet.models.correctors.interaction import (
    InteractionNetwork as InteractionNetwork,
)
from sainet.models.dynamics import AbstractDynamics as AbstractDynamics
from sainet.models.dynamics import predict as predict
from sainet.models.identity import ModelId as ModelId
from sainet.models.library import load_model as load_model
from sainet.models.model import Model as Model
from sainet.planning import make_planner as make_planner
from sainet.robots.simulated import SimulatedRobot as SimulatedRobot
from sainet.scenes.controls import ForceControls as ForceControls
from sainet.scenes.controls import PathControls as PathControls
from sainet.scenes.pushes import Push as Push
from sainet.scenes.pushes import PushGrid as PushGrid
from sainet.scenes.scene import Scene as Scene
from sainet.scenes.state import State as State
from sainet.scenes.state import Trajectory as Trajectory
from sainet.scenes.state import at_rest as at_rest
from sainet.tasks.push_to_goal import PushToGoal as PushToGoal
from sainet.worlds.noise import NoiseConfig as NoiseConfig
from sainet.worlds.setups import RobotSetup as RobotSetup
from sainet.worlds.world import SimulatedWorld as SimulatedWorld

__version__: str
