"""Settings of simulated datasets, free of JAX."""

from dataclasses import dataclass
from typing import get_args

from sainet.engines import ENGINES
from sainet.engines.simulator import SIMULATORS
from sainet.runs.errors import require, require_one_of
from sainet.scenes.quantities import MOST_PUSHES, require_count, require_seed
from sainet.worlds.config import SetupName, WorldConfig


@dataclass(frozen=True, kw_only=True)
class GenerateConfig(WorldConfig):
    """Simulated pushes with the distributions of the paper (section IV-B).

    A range is a uniform distribution between two numbers, or one constant.
    """

    setup: SetupName = "robot"
    """Setup: robot (the pusher follows a path) or direct-force (a force drives it)."""
    pushes: int = 4500
    """Number of pushes."""
    engine: str = "planar"
    """Engine of the ground truth: planar or bullet."""
    assumed_engine: tuple[str, ...] = ("planar",)
    """Engines of the stored simulator predictions: planar or bullet with the paper's
    assumed properties, planar-true or bullet-true with the true masses and radii.
    planar-overlap and planar-true-overlap do not move disks apart that overlap."""
    seed: int = 0
    """Random seed; equal seeds give byte-identical datasets."""
    chunk_size: int = 250
    """Number of pushes per chunk, which are simulated, written and read together."""

    def __post_init__(self) -> None:
        """Check every setting.

        Raises:
            BadSetting: a value is out of its range.
        """
        super().__post_init__()
        require_one_of("setup", self.setup, get_args(SetupName))
        require_one_of("engine", self.engine, ENGINES)
        names = vars(self)["assumed_engine"]  # whatever its type
        wanted = "a tuple of one or more different names"
        require(isinstance(names, tuple | list), "assumed_engine", wanted, names)
        for name in names:
            require_one_of("assumed_engine", name, SIMULATORS)
        different = len(set(names)) == len(names) > 0
        require(different, "assumed_engine", wanted, names)
        for name in ("pushes", "chunk_size"):
            require_count(name, getattr(self, name), high=MOST_PUSHES)
        require_seed(self.seed)
