"""Settings of control trials and collecting sessions, free of JAX."""

import math
from dataclasses import dataclass, replace
from typing import Literal, get_args

from sainet.planning import PLANNERS
from sainet.robots import AREA, RobotConfig
from sainet.runs.errors import require, require_one_of
from sainet.scenes.quantities import (
    ALIGNMENT,
    MOST_PUSHES,
    Quantity,
    require_count,
    require_seed,
)
from sainet.tasks import Goals

GivenProperties = Literal["true", "assumed"]
_LEAST_ROW = 2  # disks
_LEAST_TOLERANCE = 1e-6  # of a radius
_WRONG = Quantity("error", "", 0.0, 0.5)  # fraction of masses and radii


@dataclass(frozen=True, kw_only=True)
class ControlConfig(RobotConfig):
    """Model, robot, goals and number of trials."""

    model: str = "sain-any"
    """Model that plans: physics, physics-true, a shipped network, or the run
    folder of a trained network. The default accepts any number of disks; sain is the
    paper's network."""
    goals: Goals = "easy"
    """Goals: easy (within 30 degrees of the disks' axis) or hard (30 to 60 degrees to
    either side)."""
    moved: int | None = None
    """Number of the target disk in the row; the disks behind it are in its way.
    Default: the last disk."""
    obstacles: int = 0
    """Number of obstacles: the last disks, placed at random beside the target disk's
    path to the goal instead of in the row (simulated)."""
    planner: str = "greedy"
    """Planner: greedy (the paper's search) or tree (every sequence of two pushes)."""
    trials: int = 25
    """Number of trials, one goal each."""
    seed: int = 0
    """Random seed of goals, friction and noise, equal for all models."""
    pushes: int = 60
    """Maximum pushes per episode."""
    given_properties: GivenProperties = "true"
    """Masses and radii given to the network: true, or assumed (those of the internal
    engine). If the disks are swapped, the assumed properties follow them (true) or stay
    in their order (assumed)."""
    property_error: float = 0.0
    """Error of the masses and radii given to the model (fraction): each is too large or
    too small by this fraction, drawn at random for each trial."""
    adapt: bool = False
    """Estimate the properties that affect pushes (radii, ratios of masses, contact
    frictions, pressure) from the pushes of each episode, starting from the given
    properties."""
    new_surface_after: int | None = None
    """Number of pushes after which the surface changes: to the other surface of the
    virtual lab, or to a simulated table with another friction. Default: never."""
    tolerance: float = 0.1
    """Success tolerance (fraction of target-disk radius)."""
    stopping_tolerance: float = 0.9
    """Measured distance that ends an episode (fraction of the
    tolerance). The default leaves four standard deviations of measurement noise."""
    alignment: float = 3.0
    """Weight of the cosine distance in the heuristic (m), only if the target disk is
    disk 2: a longer row is steered instead."""
    expected_cost: bool = False
    """Judge pushes by the mean cost over the predicted distribution of final positions,
    with a model that has regions (a Gaussian process or an ensemble)."""
    deadline: float | None = None
    """Time limit of a decision of the tree planner (s), after which it returns the best
    plan so far. Default: none."""

    def __post_init__(self) -> None:
        """Check every setting."""
        super().__post_init__()
        is_name = isinstance(self.model, str)  # pyright: ignore
        wanted = "a name or a folder; `run_trials` takes a model of your own"
        require(is_name, "model", wanted, self.model)
        for name in ("trials", "pushes"):
            require_count(name, getattr(self, name), high=1_000_000)
        require_seed(self.seed)
        require_one_of("goals", self.goals, get_args(Goals))
        most = self.disks - _LEAST_ROW
        require_count("obstacles", self.obstacles, low=0)
        wanted = f"at most {most} with {self.disks} disks"
        require(self.obstacles <= most, "obstacles", wanted, self.obstacles)
        if self.moved is not None:
            require_count("moved", self.moved, high=self.disks - self.obstacles)
        require_one_of(
            "given_properties", self.given_properties, get_args(GivenProperties)
        )
        if (after := self.new_surface_after) is not None:
            require_count("new_surface_after", after)
            wanted = "left out if `robot` is abb; exchange its surface by hand"
            require(not self.is_physical, "new_surface_after", wanted, after)
        _WRONG.require("property_error", self.property_error)
        wanted = f"at least {_LEAST_TOLERANCE:g}, below 1"
        good = _LEAST_TOLERANCE <= self.tolerance < 1
        require(good, "tolerance", wanted, self.tolerance)
        ALIGNMENT.require("alignment", self.alignment)
        stop = self.stopping_tolerance
        require(0 < stop <= 1, "stopping_tolerance", "above 0, at most 1", stop)
        late = self.deadline is None or 0 < self.deadline < math.inf
        require(late, "deadline", "positive and finite", self.deadline)

    def with_disks(self, disks: int) -> "ControlConfig":
        """Return the settings with another number of disks.

        What so many disks do not have goes: obstacles, and the choice of a target disk.
        """
        obstacles = min(self.obstacles, disks - _LEAST_ROW)
        is_there = self.moved is not None and self.moved <= disks - obstacles
        moved = self.moved if is_there else None
        return replace(self, disks=disks, obstacles=obstacles, moved=moved)

    @property
    def target(self) -> int:
        """The index of the target disk."""
        return (self.moved or self.disks - self.obstacles) - 1

    def check_used(self) -> None:
        """Raise `BadSetting` for a setting that differs and has no effect."""
        super().check_used()
        self._check_used("area_mm", not self.starts_in_a_row, "`robot` is lab or abb")
        after = self.new_surface_after
        is_reached = after is None or after < self.pushes
        self._check_used("new_surface_after", is_reached, "it is below `pushes`")
        self._check_used("alignment", self.target == 1, "the target disk is disk 2")


_GAP = Quantity("gap", "mm", 0.01, 100.0)
_APART_MM = 113.0  # centres of touching simulated disks


@dataclass(frozen=True, kw_only=True)
class CollectConfig(RobotConfig):
    """Robot, and the pushes that are collected with it."""

    pushes: int = 1500
    """Number of pushes to record."""
    seed: int = 0
    """Random seed of pushes, positions and, in simulation, of the noise."""
    repeats: int = 1
    """Repetitions of each push, from the same arranged poses."""
    gap_mm: float = 1.0
    """Largest gap or overlap of neighbouring disks that counts as touching (mm)."""
    planner: str | None = None
    """Planner that chooses the pushes (greedy or tree), towards random goals. Default:
    random pushes."""
    model: str = "sain"
    """Model that plans the pushes."""
    goals: Goals = "hard"
    """Goals of planned pushes: easy or hard."""

    def __post_init__(self) -> None:
        """Check every setting."""
        super().__post_init__()
        for name in ("pushes", "repeats"):
            require_count(name, getattr(self, name), high=MOST_PUSHES)
        require_seed(self.seed)
        _GAP.require("gap_mm", self.gap_mm)
        if self.robot == "simulated":
            row = _APART_MM * (self.disks - 1)
            replace(AREA, low=row).require("area_mm", self.area_mm)
        if self.planner is not None:
            require_one_of("planner", self.planner, PLANNERS)
        require_one_of("goals", self.goals, get_args(Goals))

    def check_used(self) -> None:
        """Raise `BadSetting` for a setting that differs and has no effect."""
        super().check_used()
        for name in ("model", "goals"):
            self._check_used(name, self.planner is not None, "`planner` is given")
