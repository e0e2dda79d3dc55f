"""How long the steps of studies took, and how long the others are expected to take."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from time import perf_counter
from typing import Any

import msgspec

from sainet.runs.documents import read_document, write_document
from sainet.scenes.quantities import Finite
from sainet.studies.steps import Step

DURATIONS = "durations"  # folder beside the run folders
_DOUBTED = 60.0  # s, after which this machine says more than the rates of another
_SHORTEST = 0.1  # s, of a duration that is kept
_MINUTE, _HOUR = 60, 3600  # s


class Duration(msgspec.Struct, frozen=True):
    """The wall-clock time of a step, from its start to its end, without pauses."""

    seconds: Finite
    has_ended: bool


@dataclass
class Clock:
    """Times the steps of a runner and keeps their durations, one file for each.

    Steps that run at once share the time. A finished step that is run again takes next
    to no time: the longest duration counts.
    """

    out: Path | None = None  # of all run folders; None keeps nothing
    expected: Mapping[str, float] = field(default_factory=dict)
    """Seconds that each step is expected to take, by its key; none if it is missing."""
    _spent: dict[str, float] = field(default_factory=dict)
    _ended: set[str] = field(default_factory=set)
    _running: dict[str, Step[Any]] = field(default_factory=dict)
    _now: float = 0.0

    @contextmanager
    def time(self, step: Step[Any]) -> Iterator[None]:
        """Time a step, also if it fails."""
        self.begin(step)
        is_done = False
        try:
            yield
            is_done = True
        finally:
            self.end(step, is_done=is_done)

    def begin(self, step: Step[Any]) -> None:
        """Note that a step runs from now on."""
        self._tick()
        self._running[step.key] = step
        before = self.duration(step)
        if step.key not in self._spent:
            is_open = before is not None and not before.has_ended
            self._spent[step.key] = before.seconds if before and is_open else 0.0

    def end(self, step: Step[Any], *, is_done: bool = True) -> None:
        """Note that a step has ended, or was given up."""
        self._tick()
        del self._running[step.key]
        if is_done:
            self._ended.add(step.key)
        before, made = self.duration(step), Duration(self._spent[step.key], is_done)
        if self.out is None or made.seconds < _SHORTEST:
            return
        if before is None or not before.has_ended or before.seconds < made.seconds:
            write_document(self._file(self.out, step), made)

    def _tick(self) -> None:
        """Share the time since the last call among the steps that run."""
        before, self._now = self._now, perf_counter()
        for key in self._running:
            self._spent[key] += (self._now - before) / len(self._running)

    def duration(self, step: Step[Any]) -> Duration | None:
        """Return how long a step took; None if it never ran.

        Raises:
            BadInput: the file is damaged.
        """
        if self.out is None or not (path := self._file(self.out, step)).is_file():
            return None
        remedy = "delete it; only this duration is lost"
        return read_document(path, Duration, remedy=remedy)

    def remaining(self) -> float:
        """Return the seconds that the steps which have not ended will take."""
        self._tick()
        pace = self._pace
        return sum(
            max(0.0, seconds * pace - self._spent.get(key, 0.0))
            for key, seconds in self.expected.items()
            if key not in self._ended
        )

    @property
    def _pace(self) -> float:
        """The time that steps took over the expected, as far as that is known."""
        known = [key for key in self._ended if key in self.expected]
        took = sum(self._spent[key] for key in known)
        expected = sum(self.expected[key] for key in known)
        return (took + _DOUBTED) / (expected + _DOUBTED)

    @staticmethod
    def _file(out: Path, step: Step[Any]) -> Path:
        return out / DURATIONS / f"{step.folder_name}.json"


def in_words(seconds: float) -> str:
    """Return a duration in words."""
    if seconds < _MINUTE:
        return "less than a minute"
    if round(seconds) < _HOUR:
        return f"about {seconds / _MINUTE:.0f} min"
    hours, minutes = divmod(round(seconds / _MINUTE), 60)
    return f"about {hours} h {minutes} min"
