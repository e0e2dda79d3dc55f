"""A table of pushes as columns: CSV or Parquet, every value checked on its own."""

import csv
import io
from array import array
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float, Int

from sainet.datasets.mitpush_log import read_bytes
from sainet.errors import BadTable

TEXT = ("push", "body")
GROUP = "group"  # may be missing
NUMBERS = ("time", "x", "y", "angle", "pusher_x", "pusher_y")
UNITS = "time in seconds; x, y, pusher_x, pusher_y in metres; angle in radians"
LARGEST = 1 << 30  # bytes
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


def read_rows(path: Path, data: bytes | None = None) -> TableRows:
    """Read a table.

    Args:
        path: ends in .csv or .parquet.
        data: what the file holds, where that is known already.

    Raises:
        BadTable: with the file, the row (line of the file, from 1) and the way out.
        MissingExtra: it is Parquet, and pyarrow is not installed.
    """
    data = read_table_bytes(path) if data is None else data
    if path.suffix.lower() == ".parquet":
        from sainet.datasets.table_parquet import read_parquet

        rows = read_parquet(path, data)
    else:
        rows = _read_csv(path, data)
    if not len(rows.line):
        raise BadTable(f"{path}: has no rows; give one for each push, time and body.")
    return rows


def read_table_bytes(path: Path) -> bytes:
    """Return what a table's file holds.

    Raises:
        BadTable: there is no such file, or it is too large.
    """
    if path.suffix.lower() not in (".csv", ".parquet"):
        raise BadTable(f"{path}: is no .csv and no .parquet; give one of them.")
    if path.is_file() and path.stat().st_size > LARGEST:
        raise BadTable(f"{path}: has over {LARGEST >> 30} GB; split it by pushes.")
    return read_bytes(path)


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


def _read_csv(path: Path, data: bytes) -> TableRows:
    lines, texts, numbers = array("q"), {}, array("d")
    codes: dict[str, array[int]] = {}
    try:
        reader = csv.reader(io.StringIO(data.decode("utf-8-sig"), newline=""))
        header = [name.strip() for name in next(reader, [])]
        if not header:
            raise BadTable(f"{path}: is empty; its first row names the columns.")
        check_header(path, header)
        known = [name for name in (*TEXT, GROUP) if name in header]
        texts, codes = {n: {} for n in known}, {n: array("q") for n in known}
        for line, fields in _fields(path, reader, len(header)):
            row = dict(zip(header, fields, strict=True))
            lines.append(line)
            numbers.extend(_number(path, line, name, row[name]) for name in NUMBERS)
            for name in known:
                text = _text(path, line, name, row[name])
                codes[name].append(texts[name].setdefault(text, len(texts[name])))
    except (UnicodeDecodeError, csv.Error):
        raise BadTable(f"{path}: is no CSV text; save it as UTF-8 CSV.") from None
    return TableRows(
        path=path,
        line=np.array(lines, np.int64),
        codes={name: np.array(found, np.int64) for name, found in codes.items()},
        names={name: list(found) for name, found in texts.items()},
        values=np.array(numbers, float).reshape(-1, len(NUMBERS)),
    )


def _fields(path: Path, reader, count: int) -> Iterator[tuple[int, list[str]]]:  # noqa: ANN001
    rows = 0
    for fields in reader:
        if not fields:
            continue
        rows += 1
        if len(fields) != count:
            raise BadTable(
                f"{path}: row {reader.line_num}: has {len(fields)} fields, not "
                f"{count} as the header has; it is cut or broken: repair or remove it."
            )
        if rows > MOST_ROWS:
            raise BadTable(f"{path}: has over {MOST_ROWS} rows; split it by pushes.")
        yield reader.line_num, fields


def _text(path: Path, line: int, name: str, text: str) -> str:
    if not text.strip():
        raise BadTable(f"{path}: row {line}: {name} is empty; name it.")
    return text.strip()


def _number(path: Path, line: int, name: str, text: str) -> float:
    try:
        # Python reads 1_000 as a number; nobody who writes tables means that.
        value = float(text.replace("_", "?"))
    except ValueError:
        raise BadTable(
            f"{path}: row {line}: {name} is {text[:40]!r}, which is no number; "
            "repair or remove the row."
        ) from None
    if not -float("inf") < value < float("inf"):
        raise BadTable(
            f"{path}: row {line}: {name} is {value}; it must be finite; repair or "
            "remove the row."
        )
    return value
