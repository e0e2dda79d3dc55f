"""Policies: a model and a planner that choose the actions of an environment."""

from abc import ABC, abstractmethod

from sainet.control.gym.actions import Action
from sainet.control.gym.task import Observation, PushDisksTask
from sainet.models.library import Loadable, as_model
from sainet.planning import make_planner
from sainet.planning.base import AbstractPlanner, Plan
from sainet.runs.errors import require
from sainet.scenes.scene import TIME_STEP


class AbstractPolicy(ABC):
    """A model that plans for an environment, with ``act(observation) -> action``."""

    def __init__(self, model: Loadable, task: PushDisksTask) -> None:
        """Check that the model is for such pushes.

        Args:
            model: predicts; a model, its name or its folder, as `load` takes it.
            task: of the environment, ``env.unwrapped.task``.

        Raises:
            UnknownName: there is no model of this name.
            BadCheckpoint: the network is for other pushes.
            BadSetting: the task is none, but the environment for example.
        """
        is_task = isinstance(task, PushDisksTask)  # pyright: ignore
        require(is_task, "task", "that of an environment, env.unwrapped.task", task)
        self.model = as_model(model)
        self.model.check_fits("robot", TIME_STEP)
        self.task = task

    @property
    @abstractmethod
    def planner(self) -> AbstractPlanner:
        """The planner that selects pushes."""

    def plan(self, observation: Observation) -> Plan:
        """Return the plan of the next pushes, with its predicted path.

        Args:
            observation: of one environment, as `reset` or `step` returned it.

        Raises:
            BadInput: the observation is not one of the environment.
            BadScene: the observation is not finite, or disks overlap.
            Diverged: no candidate push has a finite prediction.
        """
        task, state = self.task, self.task.state(observation)
        goal = task.towards(task.goal(observation))
        return self.planner.plan(self.model.dynamics, goal, task.scene, state)

    def act(self, observation: Observation) -> Action:
        """Return the action of the first planned push, valid in the environment.

        Args and errors are those of `plan`.
        """
        return self.task.actions.action(self.plan(observation).pushes[0])


class TreePlanner(AbstractPolicy):
    """Chooses actions by a search over all sequences of two pushes."""

    @property
    def planner(self) -> AbstractPlanner:
        """The search over the full tree."""
        return make_planner("tree")


class GreedyPlanner(AbstractPolicy):
    """Chooses actions by the paper's greedy search."""

    @property
    def planner(self) -> AbstractPlanner:
        """The paper's search, with a queue and a short horizon."""
        return make_planner("greedy")
