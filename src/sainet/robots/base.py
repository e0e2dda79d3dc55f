"""The interface of robots."""

from abc import ABC, abstractmethod

from sainet.scenes.pushes import Push
from sainet.scenes.recording import Recording
from sainet.scenes.state import State


class AbstractRobot(ABC):
    """A robot, which observes disks at rest and pushes disk 1."""

    @abstractmethod
    def observe(self) -> State:
        """Return the measured poses; velocities are zero."""

    @abstractmethod
    def push(self, push: Push) -> Recording:
        """Execute a push from the last observation, and wait until all bodies rest.

        Returns:
            A recording with the commanded push; its first sample is the start.
        """
