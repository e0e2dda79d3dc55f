"""A trial on its way: its robot, its goal and what was measured last."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from sainet.control.episode import MOST_TROUBLES, checked
from sainet.control.gym.raster import Goal, Picture, View, draw
from sainet.control.gym.task import Observation, observation_of
from sainet.control.trial import Trial
from sainet.scenes.pushes import Push
from sainet.scenes.state import poses_of


@dataclass
class RunningTrial:
    """A trial on its way."""

    trial: Trial
    view: View
    pose: Float[np.ndarray, "disk 3"]  # measured last (m, m, rad)
    pushes: int = 0
    troubles: int = 0  # in a row
    is_over: bool = False

    @classmethod
    def begin(cls, trial: Trial) -> "RunningTrial":
        """Observe the disks at the start."""
        pose = poses_of(trial.robot.observe())
        return cls(trial, View.around(np.vstack([pose[:, :2], trial.task.goal])), pose)

    @property
    def goal(self) -> Float[np.ndarray, "2"]:
        """The goal of the target disk (m)."""
        return np.asarray(self.trial.task.goal)

    @property
    def observation(self) -> Observation:
        """The poses measured last and the goal."""
        return observation_of(self.pose, self.goal, self.trial.task.moved)

    @property
    def is_stuck(self) -> bool:
        """Whether several pushes in a row had a trouble."""
        return self.troubles >= MOST_TROUBLES

    def push(self, push: Push) -> str:
        """Execute a push and return its trouble, empty if it has none."""
        trouble = checked(self.trial.robot.push(push), push).trouble
        self.pushes += 1
        self.troubles = self.troubles + 1 if trouble else 0
        return trouble

    def info(self, trouble: str = "") -> dict[str, object]:
        """Return how far the true pose is from the goal, and the trouble of a push."""
        task, robot = self.trial.task, self.trial.robot
        return {
            "is_success": bool(task.is_solved(robot.scene, robot.truth)),
            "distance": float(task.distance(robot.truth)),
            "trouble": trouble,
        }

    def picture(self, tolerance: float) -> Picture:
        """Return a picture of the true poses and the goal with its tolerance (m)."""
        robot, target = self.trial.robot, self.trial.task.moved
        goal = Goal(self.goal, target, tolerance)
        return draw(self.view, robot.scene, robot.truth, goal)
