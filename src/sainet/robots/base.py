"""The interface of robots."""

from abc import ABC, abstractmethod

from sainet.scenes.pushes import Push
from sainet.scenes.recording import Recording
from sainet.scenes.scene import Scene
from sainet.scenes.state import State


class AbstractRobot(ABC):
    """A robot, which observes disks at rest and pushes disk 1."""

    @property
    @abstractmethod
    def scene(self) -> Scene:
        """Properties of the disks: true ones in simulation, else measured by people."""

    @property
    @abstractmethod
    def truth(self) -> State:
        """True poses in simulation; the last measured poses of a physical robot."""

    @abstractmethod
    def arrange(self, state: State) -> None:
        """Have the disks put at these poses, at rest; only poses are used.

        People put the disks of a physical robot, so that later observations differ.
        """

    @abstractmethod
    def observe(self) -> State:
        """Return the measured poses; velocities are zero."""

    @abstractmethod
    def push(self, push: Push) -> Recording:
        """Execute a push from the last observation, and wait until all bodies rest.

        Returns:
            A recording with the commanded push; its first sample is the start.
        """
