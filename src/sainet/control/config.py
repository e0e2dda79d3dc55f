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
from sainet.worlds.noise import NoiseLevel

Goals = Literal["easy", "hard"]
GivenProperties = Literal["true", "assumed"]
_COUNTS = {
    "trials": (1, 1_000_000),
    "pushes": (1, 1_000_000),
    "disks": (2, MOST_DISKS),
    "seed": (0, LARGEST_COUNT),
}
_LEAST_TOLERANCE = 1e-6  # of a radius


@dataclass(frozen=True, kw_only=True)
class ControlConfig:
    """Model, world, goals and number of trials."""

    model: str = "sain"
    """Model that plans: physics, physics-true, a shipped network, or the run
    folder of a trained network."""
    goals: Goals = "easy"
    """Goals: easy (within 30 degrees of the disks' axis) or hard (30 to 60 degrees to
    either side)."""
    planner: str = "greedy"
    """Planner: greedy (the paper's search) or tree (every sequence of two pushes)."""
    world: str = "planar"
    """Engine of the simulated world: planar, or bullet as in the paper."""
    trials: int = 25
    """Number of trials, one goal each."""
    seed: int = 0
    """Random seed of goals, friction and noise, equal for all models."""
    pushes: int = 60
    """Maximum pushes per episode."""
    disks: int = 2
    """Number of disks in a row; disk 1 is pushed, the last is the target disk."""
    given_properties: GivenProperties = "true"
    """Masses and radii given to the network: true, or assumed (those of the internal
    engine)."""
    tolerance: float = 0.1
    """Success tolerance (fraction of target-disk radius)."""
    stopping_tolerance: float = 0.9
    """Measured distance that ends an episode (fraction of the
    tolerance). The default leaves four standard deviations of measurement noise."""
    alignment: float = 3.0
    """Weight of the cosine distance in the heuristic (m)."""
    deadline: float | None = None
    """Time limit of a decision of the tree planner (s), after which it returns the best
    plan so far. Default: none."""
    noise_level: NoiseLevel = "default"
    """Scale of the world's noise; paper-like is three times the default."""

    def __post_init__(self) -> None:
        """Check every setting."""
        for name, (low, high) in _COUNTS.items():
            require_count(name, getattr(self, name), low=low, high=high)
        require_one_of("goals", self.goals, get_args(Goals))
        require_one_of(
            "given_properties", self.given_properties, get_args(GivenProperties)
        )
        require_one_of("noise_level", self.noise_level, get_args(NoiseLevel))
        wanted = f"at least {_LEAST_TOLERANCE:g}, below 1"
        good = _LEAST_TOLERANCE <= self.tolerance < 1
        require(good, "tolerance", wanted, self.tolerance)
        ALIGNMENT.require("alignment", self.alignment)
        stop = self.stopping_tolerance
        require(0 < stop <= 1, "stopping_tolerance", "above 0, at most 1", stop)
        late = self.deadline is None or 0 < self.deadline < math.inf
        require(late, "deadline", "positive and finite", self.deadline)
