"""Robots, which observe disks and execute pushes, and their settings; free of JAX."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Literal, get_args

from sainet.runs.errors import require, require_one_of
from sainet.runs.names import load_named
from sainet.scenes.quantities import MOST_DISKS, Quantity, require_count
from sainet.worlds.noise import NoiseLevel

if TYPE_CHECKING:
    from sainet.robots.base import AbstractRobot

ROBOTS = {
    "simulated": "sainet.robots.simulated:simulated_robot",
    "lab": "sainet.robots.lab.robot:lab_robot",
    "abb": "sainet.robots.wire.connect:abb_robot",
}
Surface = Literal["abs", "plywood"]
SURFACES: tuple[Surface, ...] = get_args(Surface)
_MOST_LABS = 1_000_000
_PHYSICAL = "abb"
AREA = Quantity("area", "mm", 1.0, 10_000.0)
_LAB_AREA = replace(AREA, low=111.0)  # the distance of its touching disks
# Settings that other robots do not have.
_OF_ROBOTS = {
    "world": "simulated",
    "noise_level": "simulated",
    "lab": "lab",
    "surface": "lab",
}


@dataclass(frozen=True, kw_only=True)
class RobotConfig:
    """What executes pushes: a simulated robot, a virtual lab, or a physical robot."""

    robot: str = "simulated"
    """Robot: simulated (by the planar engine or Bullet), lab (a virtual lab, simulated
    in 3-D by MuJoCo) or abb (a physical robot)."""
    world: str = "planar"
    """Engine of the simulated world: planar, or bullet as in the paper."""
    disks: int = 2
    """Number of disks on the table; disk 1 is pushed. They touch in a row."""
    noise_level: NoiseLevel = "default"
    """Scale of the world's noise; paper-like is three times the default."""
    lab: int = 0
    """Number of the virtual lab, the seed of its hidden properties; the studies use
    labs 0 to 4."""
    surface: Surface = "abs"
    """Surface of the virtual lab: abs or plywood."""
    swapped: bool = False
    """Exchange the two disks of the virtual lab, so that the larger one is pushed."""
    area_mm: float = 300.0
    """Side of the square around the table's origin in which the centres of the disks
    are arranged (mm), at least as long as their row; in control: for lab and abb."""
    config: Path | None = None
    """Configuration of the cell of the physical robot (TOML). Default: none."""
    # Not part of any run: nothing is recorded.
    dry_run: bool = field(default=False, repr=False, compare=False)
    """Show every command to the physical robot, and send none."""

    def __post_init__(self) -> None:
        """Check every setting."""
        require_one_of("robot", self.robot, ROBOTS)
        wanted = "planar or bullet; `robot` selects the virtual lab"
        require(self.world != "lab", "world", wanted, self.world)
        require_one_of("noise_level", self.noise_level, get_args(NoiseLevel))
        require_one_of("surface", self.surface, SURFACES)
        require_count("disks", self.disks, low=2, high=MOST_DISKS)
        require_count("lab", self.lab, low=0, high=_MOST_LABS)
        two = self.robot == "simulated" or self.disks == 2  # noqa: PLR2004
        require(two, "disks", "2 unless `robot` is simulated", self.disks)
        area = _LAB_AREA if self.robot == "lab" else AREA
        area.require("area_mm", self.area_mm)
        known = self.is_physical == (self.config is not None)
        wanted = f"the file of a cell if `robot` is {_PHYSICAL}, and left out otherwise"
        require(known, "config", wanted, self.config)
        can_be = not self.dry_run or self.is_physical
        require(can_be, "dry_run", f"false unless `robot` is {_PHYSICAL}", self.dry_run)
        still = not self.swapped or self.robot == "lab"
        require(still, "swapped", "false unless `robot` is lab", self.swapped)

    @property
    def is_physical(self) -> bool:
        """Whether the robot exists: it cannot be made twice, nor be set back."""
        return self.robot == _PHYSICAL

    @property
    def starts_in_a_row(self) -> bool:
        """Whether trials start with disks along the x axis, not anywhere."""
        return self.robot == "simulated"

    def check_used(self) -> None:
        """Raise `BadSetting` for a setting that differs and has no effect.

        Programs that choose among robots may keep settings of all of them; whoever
        gives one robot such a setting takes it for another.
        """
        for name, robot in _OF_ROBOTS.items():
            self._check_used(name, self.robot == robot, f"`robot` is {robot}")

    def _check_used(self, name: str, is_used: bool, where: str) -> None:  # noqa: FBT001
        """Raise `BadSetting` unless a setting is used or as it is without use."""
        value, usual = getattr(self, name), getattr(type(self), name)
        require(is_used or value == usual, name, f"left out unless {where}", value)

    def settings(self) -> Mapping[str, object]:
        """Return every setting as a JSON value, for run folders.

        Raises:
            BadInput: the configuration of the cell cannot be used.
        """
        found = asdict(self)
        if self.config is not None:
            from sainet.robots.wire.connect import configured_cell

            # The file may move, and the arm may be repaired, between resumptions.
            found["config"] = configured_cell(self).digest
        del found["dry_run"]
        return found


def make_robot(config: RobotConfig, *seed: int) -> "AbstractRobot":
    """Return the robot of these settings.

    Args:
        config: kind of the robot, and the settings of that kind.
        seed: numbers from which a simulation draws its noise.

    Raises:
        MissingExtra: the robot needs a package that is not installed.
        BadInput: the configuration of a physical robot cannot be used.
    """
    return load_named("robot", ROBOTS, config.robot)(config, *seed)
