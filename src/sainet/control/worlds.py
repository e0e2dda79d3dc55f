"""Worlds by name: what executes pushes in simulation. Free of JAX."""

from dataclasses import dataclass, replace
from typing import Literal, get_args

from sainet.control.config import ControlConfig
from sainet.runs.errors import require, require_one_of
from sainet.worlds.noise import NoiseLevel

WorldName = Literal["planar", "bullet", "lab"]
_LAB_DISKS = 2


@dataclass(frozen=True, kw_only=True)
class TableConfig:
    """World, and the disks on its table."""

    world: WorldName = "planar"
    """World that executes pushes: planar or bullet (simulated), or lab (the virtual
    lab, simulated in 3-D)."""
    noise_level: NoiseLevel = "default"
    """Scale of the noise of planar and bullet: none, default or paper-like (three times
    the default)."""
    disks: int = 2
    """Number of disks; disk 1 is pushed."""
    moved: int | None = None
    """Number of the target disk in the row. Default: the last disk."""
    obstacles: int = 0
    """Number of obstacles: the last disks, placed at random beside the target disk's
    path to the goal instead of in the row."""

    def on_table(self, usual: ControlConfig) -> ControlConfig:
        """Return other settings with this world and these disks.

        Raises:
            BadSetting: there is no such world, or it does not have so many disks.
        """
        require_one_of("world", self.world, get_args(WorldName))
        disks = replace(
            usual,
            noise_level=self.noise_level,
            disks=self.disks,
            moved=self.moved,
            obstacles=self.obstacles,
        )
        return in_world(disks, self.world)


def in_world(config: ControlConfig, world: WorldName) -> ControlConfig:
    """Return the settings in another world.

    Raises:
        BadSetting: the world does not have so many disks.
    """
    is_lab = world == "lab"
    few = not is_lab or config.disks == _LAB_DISKS
    require(few, "disks", f"{_LAB_DISKS} in the virtual lab", config.disks)
    robot = "lab" if is_lab else "simulated"
    engine = "planar" if is_lab else world
    return replace(config, robot=robot, world=engine)


def world_of(config: ControlConfig) -> WorldName:
    """Return the name of the world that settings describe."""
    if config.robot == "lab":
        return "lab"
    return "bullet" if config.world == "bullet" else "planar"
