"""Trackers, which give frames with the poses of named bodies."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass

from sainet.robots.wire.frames import Rigid


@dataclass(frozen=True)
class Frame:
    """Poses of all bodies that a tracker names at one moment, in its own frame."""

    number: int  # increases by one with every frame
    time: float  # s, on this computer's clock, when it arrived
    bodies: Mapping[str, Rigid]
    trouble: str = ""  # why it cannot be used


class AbstractTracker(ABC):
    """A source of frames, which owns its connection."""

    @abstractmethod
    def frames(self) -> list[Frame]:
        """Return the frames that arrived since the last call, without waiting."""

    @abstractmethod
    def discard(self) -> None:
        """Drop the frames that wait."""

    @abstractmethod
    def close(self) -> None:
        """Stop listening."""
