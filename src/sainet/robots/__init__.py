"""Robots, which observe disks and execute pushes."""

from typing import TYPE_CHECKING

from sainet.runs.names import load_named

if TYPE_CHECKING:
    from sainet.robots.base import AbstractRobot
    from sainet.robots.config import RobotConfig

ROBOTS = {
    "simulated": "sainet.robots.simulated:simulated_robot",
    "lab": "sainet.robots.lab.robot:lab_robot_of",
    "abb": "sainet.robots.wire.abb:abb_robot",
}


def make_robot(config: "RobotConfig", *seed: int) -> "AbstractRobot":
    """Return the robot of these settings.

    Args:
        config: kind of the robot, and the settings of that kind.
        seed: numbers from which a simulation draws its noise.

    Raises:
        MissingExtra: the robot needs a package that is not installed.
        BadInput: the configuration of a physical robot cannot be used.
    """
    return load_named("robot", ROBOTS, config.robot)(config, *seed)
