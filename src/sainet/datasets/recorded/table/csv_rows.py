"""A table of pushes as columns, from CSV: every value is checked on its own."""

import csv
import io
from array import array
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from sainet.datasets.recorded.table.rows import (
    GROUP,
    MOST_ROWS,
    NUMBERS,
    TEXT,
    TableRows,
    check_header,
)
from sainet.runs.errors import BadTable


def read_csv(path: Path, data: bytes) -> TableRows:
    """Read a table; its rows are the lines of the file, from 1.

    Args:
        path: to name in messages.
        data: what the file holds.

    Raises:
        BadTable: with the row and the way out.
    """
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
