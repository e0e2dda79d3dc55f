"""The interface of robots."""

from abc import ABC, abstractmethod

from sainet.scenes.pushes import Push
from sainet.scenes.recording import Recording
from sainet.scenes.scene import Scene
from sainet.scenes.state import State


class AbstractRobot(ABC):
    """A robot, which observes disks at rest and pushes disk 1.

    As a context manager it closes its connections at the end.
    """

    def __enter__(self) -> "AbstractRobot":
        """Return this robot."""
        return self

    def __exit__(self, *error: object) -> None:  # noqa: B027
        """Close the connections, if there are any."""

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

    def resume(self, left: State | None, *seed: int) -> None:  # noqa: B027
        """Continue where a push left the disks, with noise from these numbers.

        A simulation goes on as if it had just executed that push. The disks of a
        physical robot lie where they were left, so that it does nothing.

        Args:
            left: true poses after the push; None: the disks are arranged next.
            seed: numbers from which the noise from here on is drawn.
        """

    @abstractmethod
    def observe(self) -> State:
        """Return the measured poses; velocities are zero."""

    @abstractmethod
    def push(self, push: Push) -> Recording:
        """Execute a push from the last observation, and wait until all bodies rest.

        Returns:
            A recording with the commanded push; its first sample is the start.

        Raises:
            BadScene: the push is out of range; nothing was moved.
        """
