"""Tables: cells in columns and lines, and the sentences below them.

`arrange` makes them from a summary, once; the five writers print their cells.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

DASH = "–"  # noqa: RUF001  (an en dash stands for a missing number)
NOTE = (
    "Small print: 95 % interval over pushes, and over training runs if there are "
    "several. Bold: the best of a column."
)
EMPTY = "Nothing to show: the evaluation has no numbers."


@dataclass(frozen=True)
class Cell:
    """The text of one number and of its interval."""

    text: str
    interval: str = ""
    is_best: bool = False


@dataclass(frozen=True)
class Column:
    """One quantity, with a cell for each body or one cell without any."""

    key: str
    heading: str
    unit: str = ""
    bodies: tuple[int, ...] = ()  # 1-based

    @property
    def title(self) -> str:
        """The heading with its unit."""
        return f"{self.heading} ({self.unit})" if self.unit else self.heading

    @property
    def width(self) -> int:
        """The number of its cells."""
        return len(self.bodies) or 1


@dataclass(frozen=True)
class Line:
    """One model in one condition."""

    condition: str  # empty: the only one
    model: str  # slug
    label: str
    cells: tuple[Cell, ...]  # column by column, in each body by body
    count: int | None = None  # pushes


@dataclass(frozen=True)
class Table:
    """The content of a table, for any writer."""

    columns: tuple[Column, ...]
    lines: tuple[Line, ...]
    published: tuple[Line, ...] = ()
    notes: tuple[str, ...] = ()  # on lines that are left out
    sentences: tuple[str, ...] = ()  # comparisons
    verdicts: tuple[str, ...] = ()
    samples: str = "Pushes"
    note: str = NOTE

    @property
    def is_empty(self) -> bool:
        """Whether there is no number to show."""
        return not self.columns

    @property
    def has_conditions(self) -> bool:
        """Whether any line is of some of the samples, not of all."""
        return any(line.condition for line in self.lines + self.published)

    @property
    def has_counts(self) -> bool:
        """Whether the number of pushes has a column."""
        return any(line.count is not None for line in self.lines)

    def cells_of(self, line: Line, column: Column) -> tuple[Cell, ...]:
        """Return the cells of one line in one column."""
        before = self.columns[: self.columns.index(column)]
        start = sum(each.width for each in before)
        return line.cells[start : start + column.width]

    def present_of(self, line: Line, column: Column) -> tuple[Cell, ...]:
        """Return the cells of the disks that the line has: others may have more."""
        every = [self.cells_of(line, each) for each in self.columns if each.bodies]
        known = [
            n for cells in every for n, cell in enumerate(cells, 1) if cell.text != DASH
        ]
        cells = self.cells_of(line, column)
        return cells[: max(known, default=len(cells))] if column.bodies else cells

    def part(self, keys: Sequence[str]) -> "Table":
        """Return the same lines with some of the columns."""
        kept = tuple(column for column in self.columns if column.key in keys)

        def cut(line: Line) -> Line:
            cells = [cell for one in kept for cell in self.cells_of(line, one)]
            return replace(line, cells=tuple(cells))

        return replace(
            self,
            columns=kept,
            lines=tuple(map(cut, self.lines)),
            published=tuple(map(cut, self.published)),
        )
