"""The world behind the page: the robot that executes pushes."""

from dataclasses import dataclass

from sainet.control.config import ControlConfig
from sainet.report.live.messages import SetProperties
from sainet.robots import make_robot
from sainet.robots.base import AbstractRobot
from sainet.robots.simulated import robot_among
from sainet.scenes.scene import Scene


@dataclass(frozen=True)
class Properties:
    """True properties of the disks and the table, set by the user."""

    mass: tuple[float, ...]  # kg
    radius: tuple[float, ...]  # m
    table_friction: float

    @classmethod
    def of(cls, message: SetProperties) -> "Properties":
        """Return the properties in a message."""
        radius = tuple(radius / 1000 for radius in message.radius_mm)
        return cls(tuple(message.mass_kg), radius, message.table_friction)

    @property
    def scene(self) -> Scene:
        """The scene with these properties."""
        friction = self.table_friction
        return Scene.disks(self.mass, self.radius, table_friction=friction)


def make_world(
    control: ControlConfig, properties: Properties | None, index: int
) -> AbstractRobot:
    """Return the robot of an episode, its disks in a row.

    Args:
        control: world, noise, disks and seed.
        properties: set by the user; None: those of `sainet control`.
        index: of the episode; friction and noise are drawn from it and the seed.

    Raises:
        MissingExtra: the world needs a package that is not installed.
    """
    if properties is None:
        return make_robot(control, control.seed, index)
    return robot_among(control, properties.scene, control.seed, index)
