"""Worlds by name: what executes pushes in simulation. Free of JAX."""

from dataclasses import replace
from typing import Literal

from sainet.control.config import ControlConfig
from sainet.runs.errors import require

WorldName = Literal["planar", "bullet", "lab"]
_LAB_DISKS = 2


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
