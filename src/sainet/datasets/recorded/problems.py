"""Problems of the files of one import, reported together."""

import logging
from pathlib import Path

from sainet.runs.errors import BadTable
from sainet.scenes.quantities import Quantity

MOST_PROBLEMS = 20  # lines of one message
_log = logging.getLogger(__name__)


class Problems:
    """Problems of the files of one import, one line each."""

    def __init__(self) -> None:
        """Begin without a problem."""
        self._lines: dict[str, list[str]] = {}  # by kind
        self._count = 0
        self._of_files = False

    def add(self, kind: str, line: str, *, of_push: bool = False) -> None:
        """Add a problem.

        Args:
            kind: equal for equal problems of different rows.
            line: file, row, field, value and remedy.
            of_push: whether only one push has the problem, which may be left out.
        """
        self._count += 1
        self._of_files |= not of_push
        lines = self._lines.setdefault(kind, [])
        if len(lines) < MOST_PROBLEMS:
            lines.append(line)

    def check(
        self, quantity: Quantity, value: float, where: str, *, of_push: bool = False
    ) -> bool:
        """Return whether a value is in its range; if not, add the problem."""
        try:
            quantity.check(value, where, error=BadTable)
        except BadTable as error:
            self.add(quantity.name, str(error), of_push=of_push)
            return False
        return True

    def __bool__(self) -> bool:
        """Return whether any problem was found."""
        return bool(self._lines)

    @property
    def lines(self) -> tuple[str, ...]:
        """The message of 20 lines at most: the first of each kind, then others."""
        first = [lines[0] for lines in self._lines.values()]
        others = [line for lines in self._lines.values() for line in lines[1:]]
        shown = (first + others)[:MOST_PROBLEMS]
        more = self._count - len(shown)
        return (*shown, *([f"and {more} more problem{'s' * (more > 1)}."] * bool(more)))

    def raise_any(self, *, skip_bad: bool = False, good: int = 0) -> None:
        """Raise `BadTable` if there are problems.

        Args:
            skip_bad: leave out the pushes that have a problem. Problems of whole files
                are raised all the same.
            good: number of pushes without a problem. If there are more problems, for
                example by a mistaken unit, the message does not propose to skip.
        """
        if self and (self._of_files or not skip_bad):
            hint = f"Give `skip_bad` to leave bad pushes out; {good} have no problem."
            are_few = good > self._count and not self._of_files
            raise BadTable(*self.lines, *[hint] * are_few)

    def warn(self, path: Path, left_out: int, pushes: int) -> None:
        """Log how many pushes of a file are left out, and why."""
        if left_out:
            _log.warning("%s: %d of %d pushes left out:", path, left_out, pushes)
        for line in self.lines:
            _log.warning("%s", line)
