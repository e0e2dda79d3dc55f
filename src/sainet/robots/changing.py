"""A simulated robot whose disks lie on another surface after some pushes."""

from collections.abc import Callable
from dataclasses import replace

from sainet.robots import SURFACES, RobotConfig, make_robot
from sainet.robots.base import AbstractRobot
from sainet.scenes.pushes import Push
from sainet.scenes.recording import Recording
from sainet.scenes.scene import Scene
from sainet.scenes.state import State

_OTHER = 1  # last number of the seed of the other surface


class ChangingRobot(AbstractRobot):
    """Pushes on one surface, then on another one, from where the disks were left."""

    def __init__(
        self, robot: AbstractRobot, pushes: int, later: Callable[[State], AbstractRobot]
    ) -> None:
        """Begin on the first surface.

        Args:
            robot: a simulation, which executes the first pushes.
            pushes: number of the first pushes.
            later: returns the simulation of all others, from where the first pushes
                left the disks.
        """
        self._robot, self._left, self._make_later = robot, pushes, later

    @property
    def scene(self) -> Scene:
        """Properties of the disks, and of the surface that they lie on now."""
        return self._robot.scene

    @property
    def truth(self) -> State:
        """The true poses."""
        return self._robot.truth

    def arrange(self, state: State) -> None:
        """Have the disks put at these poses."""
        self._robot.arrange(state)

    def resume(self, left: State | None, *seed: int) -> None:
        """Continue on the present surface."""
        self._robot.resume(left, *seed)

    def observe(self) -> State:
        """Return the measured poses."""
        return self._robot.observe()

    def push(self, push: Push) -> Recording:
        """Execute a push on the present surface; after the last of it, change."""
        recording = self._robot.push(push)
        self._left -= 1
        if self._left == 0:
            self._robot = self._make_later(self.truth)
        return recording


def changing_robot(
    config: RobotConfig, pushes: int | None, *seed: int
) -> AbstractRobot:
    """Return the robot of a simulation whose surface changes after some pushes.

    The virtual lab has its other surface then, a simulated world a table of another
    friction.

    Args:
        config: of the robot; without a change it may be a physical one.
        pushes: number of pushes before the change; None: the surface stays.
        seed: as of `make_robot`.
    """
    robot = make_robot(config, *seed)
    if pushes is None:
        return robot
    (surface,) = set(SURFACES) - {config.surface}
    other = replace(config, surface=surface) if config.robot == "lab" else config

    def later(left: State) -> AbstractRobot:
        robot = make_robot(other, *seed, _OTHER)
        robot.resume(left, *seed, _OTHER)
        return robot

    return ChangingRobot(robot, pushes, later)
