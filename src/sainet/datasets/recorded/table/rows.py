"""A table of pushes as columns, whatever file they came from."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float, Int

from sainet.runs.errors import BadTable

TEXT = ("push", "body")
GROUP = "group"  # may be missing
NUMBERS = ("time", "x", "y", "angle", "pusher_x", "pusher_y")
UNITS = "time in seconds; x, y, pusher_x, pusher_y in metres; angle in radians"
MOST_ROWS = 20_000_000


@dataclass(frozen=True)
class TableRows:
    """The columns of a table; texts as codes into their lists of names."""

    path: Path
    line: Int[np.ndarray, " row"]  # of the file, from 1
    codes: dict[str, np.ndarray]  # by column: push, body, group
    names: dict[str, list[str]]  # by column, in the order in which they first appear
    values: Float[np.ndarray, "row 6"]  # in the order of NUMBERS

    def column(self, name: str) -> Float[np.ndarray, " row"]:
        """Return one column of numbers."""
        return self.values[:, NUMBERS.index(name)]

    def bad(self, row: int | np.integer, problem: str) -> BadTable:
        """Say what is wrong in a row, with the file and the row's line."""
        return BadTable(f"{self.path}: row {self.line[row]}: {problem}.")


def check_header(path: Path, header: list[str]) -> None:
    """Check the names of the columns.

    Raises:
        BadTable: a column is missing, there twice or unknown.
    """
    wanted = (*TEXT, *NUMBERS)
    for name in wanted:
        if header.count(name) != 1:
            found = "missing" if name not in header else "there twice"
            raise BadTable(
                f"{path}: row 1: column {name} is {found}; the columns are "
                f"{', '.join(wanted)} and maybe {GROUP} ({UNITS})."
            )
    for name in header:
        if name not in (*wanted, GROUP) or header.count(name) > 1:
            raise BadTable(
                f"{path}: row 1: column {name[:40]!r} is unknown or there twice; the "
                f"columns are {', '.join(wanted)} and maybe {GROUP}: remove it."
            )
