"""What every robot can do, and what it tells of a push."""

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from sainet.scenes.pushes import Push
from sainet.scenes.state import State


@dataclass(frozen=True)
class Recording:
    """A push as it was executed, and what was seen of it."""

    push: Push  # as it was sent, after every limit
    path: Float[np.ndarray, "time body 3"]  # m, m, rad after each step
    pusher: Float[np.ndarray, "time 2"]  # m
    trouble: str | None = None  # why it is not what was asked for, if so


class AbstractRobot(ABC):
    """Observes disks at rest and pushes the first one."""

    @abstractmethod
    def observe(self) -> State:
        """Return where the disks are, as far as the robot can tell."""

    @abstractmethod
    def push(self, push: Push) -> Recording:
        """Execute a push from the last observation, and wait until all rests."""
