"""Settings of control trials, free of JAX."""

import math
from dataclasses import dataclass
from typing import Literal, get_args

from sainet.runs.errors import require, require_one_of
from sainet.scenes.quantities import (
    ALIGNMENT,
    LARGEST_COUNT,
    MOST_DISKS,
    require_count,
)
from sainet.worlds.noise_config import NoiseLevel

Goals = Literal["easy", "hard"]
Knowledge = Literal["true", "nominal"]
_COUNTS = {
    "trials": (1, 1_000_000),
    "pushes": (1, 1_000_000),
    "disks": (2, MOST_DISKS),
    "seed": (0, LARGEST_COUNT),
}
_LEAST_TOLERANCE = 1e-6  # of a radius


@dataclass(frozen=True, kw_only=True)
class ControlConfig:
    """Which model pushes in which world, how often, and to what goals."""

    model: str = "sain"
    """physics, physics-true, a shipped network, or a trained one's folder."""
    goals: Goals = "easy"
    """easy: within 30 degrees of the disks' axis. hard: 30 to 60 to either side."""
    planner: str = "greedy"
    """greedy: the paper's search. tree: every sequence of two pushes."""
    world: str = "planar"
    """Engine that stands for the robot's world: planar, or bullet as in the paper."""
    trials: int = 25
    """Goals to push to, each once."""
    seed: int = 0
    """Of goals, friction and noise; models see the same ones."""
    pushes: int = 60
    """Pushes before an episode is given up."""
    disks: int = 2
    """Disks in a row, the last of which is to be moved by pushing the first."""
    knows: Knowledge = "true"
    """What the network is told of the disks: their true masses and radii, or the
    nominal ones that the assumed engine believes in."""
    tolerance: float = 0.1
    """Of the moved disk's radius, within which its goal is reached."""
    aim: float = 0.9
    """Of the tolerance, within which the disk has to be seen before an episode ends:
    sight is noisy, and this leaves room for four standard deviations of it."""
    alignment: float = 3.0
    """Weight (m) of the cosine distance in the heuristic."""
    deadline: float | None = None
    """Seconds after which the tree planner takes the best plan so far."""
    noise_level: NoiseLevel = "default"
    """Size of the world's noise: none, default or paper-like."""

    def __post_init__(self) -> None:
        """Check every setting."""
        for name, (low, high) in _COUNTS.items():
            require_count(name, getattr(self, name), low=low, high=high)
        require_one_of("goals", self.goals, get_args(Goals))
        require_one_of("knows", self.knows, get_args(Knowledge))
        require_one_of("noise_level", self.noise_level, get_args(NoiseLevel))
        wanted = f"at least {_LEAST_TOLERANCE:g}, below 1"
        good = _LEAST_TOLERANCE <= self.tolerance < 1
        require(good, "tolerance", wanted, self.tolerance)
        ALIGNMENT.require("alignment", self.alignment)
        require(0 < self.aim <= 1, "aim", "above 0, at most 1", self.aim)
        late = self.deadline is None or 0 < self.deadline < math.inf
        require(late, "deadline", "positive and finite", self.deadline)
