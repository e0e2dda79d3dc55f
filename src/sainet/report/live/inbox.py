"""Messages that wait for their answer; of pointer messages only the newest."""

import asyncio
import math
import time
from collections import deque
from collections.abc import Callable, Hashable
from dataclasses import dataclass
from typing import Generic, TypeVar

from sainet.report.live.messages import Message

_MOST_WAITING = 64
_PER_SECOND = 150.0  # messages of one page; a pointer sends 60
_BURST = 300.0  # messages
_QUIET = 1.0  # s between two notices


Sender = TypeVar("Sender", bound=Hashable)


@dataclass(frozen=True)
class Letter(Generic[Sender]):
    """A message and the connection that it came from."""

    sender: Sender
    message: Message

    def replaces(self, older: "Letter[Sender]") -> bool:
        """Whether the older message no longer matters."""
        mine, other = self.message, older.message
        return self.sender == older.sender and mine.stream == other.stream


class Inbox(Generic[Sender]):
    """Waiting messages, in order.

    A pointer message replaces the waiting one of its stream, but never one from before
    a push: the push happens where the disks were then.
    """

    def __init__(self) -> None:
        """Start empty."""
        self._waiting: deque[Letter[Sender]] = deque()
        self._has_come = asyncio.Event()

    def put(self, letter: Letter[Sender]) -> bool:
        """Add a message; False if too many wait, and this one is dropped."""
        if letter.message.is_pointer and self._replace(letter):
            return True
        if len(self._waiting) >= _MOST_WAITING:
            return False
        self._waiting.append(letter)
        self._has_come.set()
        return True

    async def next(self) -> Letter[Sender]:
        """Return the oldest message as soon as there is one."""
        while not self._waiting:
            self._has_come.clear()
            await self._has_come.wait()
        return self._waiting.popleft()

    def _replace(self, letter: Letter[Sender]) -> bool:
        for index in range(len(self._waiting) - 1, -1, -1):
            if not self._waiting[index].message.is_pointer:
                return False
            if letter.replaces(self._waiting[index]):
                self._waiting[index] = letter
                return True
        return False


@dataclass
class Allowance:
    """Messages that a connection may send: a rate, and a burst."""

    clock: Callable[[], float] = time.monotonic
    left: float = _BURST
    is_news: bool = False  # whether the last refusal is the first for a second

    def __post_init__(self) -> None:
        """Start the clock."""
        self._since = self.clock()
        self._said = -math.inf  # time of the last news

    def take(self) -> bool:
        """Whether one more message is allowed; it is counted if so."""
        now = self.clock()
        self.left = min(_BURST, self.left + _PER_SECOND * (now - self._since))
        self._since = now
        if self.left >= 1:
            self.left -= 1
            return True
        self.is_news = now - self._said > _QUIET
        self._said = now if self.is_news else self._said
        return False
