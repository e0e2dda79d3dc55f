"""How long the steps of studies took, and how long the others are expected to take."""

from collections.abc import Iterator, Mapping, Sequence
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

    A step that runs beside others gets its share of the time. A finished step that is
    run again takes next to no time: the longest duration counts.
    """

    out: Path  # of all run folders
    expected: Mapping[str, float] = field(default_factory=dict)
    """Seconds that each step is expected to take, by its key; none if it is missing."""
    _spent: dict[str, float] = field(default_factory=dict)
    _ended: set[str] = field(default_factory=set)
    _current: tuple[str, ...] = ()

    @contextmanager
    def time(self, steps: Sequence[Step[Any]], *, are_done: bool) -> Iterator[None]:
        """Time some work on steps, also if it fails.

        Args:
            steps: what is worked on; each gets its share of the time.
            are_done: whether the steps are done after it.
        """
        shares = [self.expected.get(step.key, 0.0) or 1e-9 for step in steps]
        self._current, start = tuple(step.key for step in steps), perf_counter()
        has_ended = False
        try:
            yield
            has_ended = are_done
        finally:
            took, whole = perf_counter() - start, sum(shares)
            for step, share in zip(steps, shares, strict=True):
                self._add(step, took * share / whole, has_ended=has_ended)
            self._current = ()

    def _add(self, step: Step[Any], seconds: float, *, has_ended: bool) -> None:
        before = self.duration(step)
        if step.key not in self._spent:
            is_open = before is not None and not before.has_ended
            self._spent[step.key] = before.seconds if before and is_open else 0.0
        self._spent[step.key] += seconds
        if has_ended:
            self._ended.add(step.key)
        made = Duration(self._spent[step.key], has_ended)
        if made.seconds < _SHORTEST:
            return
        if before is None or not before.has_ended or before.seconds < made.seconds:
            write_document(self._file(step), made)

    def duration(self, step: Step[Any]) -> Duration | None:
        """Return how long a step took; None if it never ran.

        Raises:
            BadInput: the file is damaged.
        """
        path = self._file(step)
        remedy = "delete it; only this duration is lost"
        return read_document(path, Duration, remedy=remedy) if path.is_file() else None

    def remaining(self, done: float = 0.0) -> float:
        """Return the seconds that the steps which have not ended will take.

        Args:
            done: the share of the current steps that is done.
        """
        left = sum(s for key, s in self.expected.items() if key not in self._ended)
        left -= done * sum(self.expected.get(key, 0.0) for key in self._current)
        return left * self._pace

    @property
    def _pace(self) -> float:
        """The time that steps took over the expected, as far as that is known."""
        known = [key for key in self._ended if key in self.expected]
        took = sum(self._spent[key] for key in known)
        expected = sum(self.expected[key] for key in known)
        return (took + _DOUBTED) / (expected + _DOUBTED)

    def _file(self, step: Step[Any]) -> Path:
        return self.out / DURATIONS / f"{step.folder_name}.json"


def in_words(seconds: float) -> str:
    """Return a duration in words."""
    if seconds < _MINUTE:
        return "less than a minute"
    if round(seconds) < _HOUR:
        return f"about {seconds / _MINUTE:.0f} min"
    hours, minutes = divmod(round(seconds / _MINUTE), 60)
    return f"about {hours} h {minutes} min"
