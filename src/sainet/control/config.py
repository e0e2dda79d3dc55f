"""Settings of control trials, free of JAX."""

import math
from dataclasses import dataclass
from typing import Literal

from sainet.runs.errors import require_option
from sainet.worlds.noise_config import NoiseLevel

Goals = Literal["easy", "hard"]
Knowledge = Literal["true", "nominal"]


@dataclass(frozen=True, kw_only=True)
class ControlConfig:
    """Which model pushes in which world, how often, and to what goals."""

    model: str = "sain"
    """physics, physics-calibrated, a shipped network, or a trained one's folder."""
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
        """Refuse settings that no trial can have."""
        for name in ("trials", "pushes"):
            value = getattr(self, name)
            require_option(value >= 1, name, "at least 1", value)
        require_option(self.disks >= 2, "disks", "at least 2", self.disks)  # noqa: PLR2004
        require_option(self.seed >= 0, "seed", "at least 0", self.seed)
        require_option(
            0 < self.tolerance < 1, "tolerance", "between 0 and 1", self.tolerance
        )
        require_option(0 < self.aim <= 1, "aim", "above 0, at most 1", self.aim)
        aligned = 0 <= self.alignment < math.inf
        require_option(aligned, "alignment", "0 or more, finite", self.alignment)
        late = self.deadline is None or 0 < self.deadline < math.inf
        require_option(late, "deadline", "positive and finite", self.deadline)
