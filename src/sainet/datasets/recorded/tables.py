"""Tables of recorded pushes: named columns of one file, and problems by row."""

import csv
import io
from array import array
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from difflib import get_close_matches
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float, Int

from sainet.datasets.recorded.problems import MOST_PROBLEMS, Problems
from sainet.runs.documents import read_file
from sainet.runs.errors import BadTable
from sainet.scenes.quantities import Quantity

LARGEST = 1 << 30  # bytes
MOST_ROWS = 20_000_000
SHOWN = 40  # characters of a quoted value
_SEPARATORS = {";": "semicolons", "\t": "tabs"}


@dataclass(frozen=True, kw_only=True)
class Columns:
    """Columns of a format: texts, of which some may be missing, and numbers."""

    texts: tuple[str, ...]
    numbers: tuple[str, ...]
    optional: tuple[str, ...] = ()  # texts
    allows_others: bool = False
    note: str = ""  # units, for messages

    @property
    def wanted(self) -> tuple[str, ...]:
        """The columns that must be there."""
        return self.texts + self.numbers

    def check(self, path: Path, header: Sequence[str], problems: Problems) -> bool:
        """Return whether all columns are there once.

        Columns that are missing, duplicated or unknown are added to the problems.
        """
        known = (*self.wanted, *self.optional)
        unknown = [n or "(unnamed)" for n in dict.fromkeys(header) if n not in known]
        wrong = {
            "missing": [n for n in self.wanted if n not in header],
            "there twice": [n for n in known if header.count(n) > 1],
            "unknown": [] if self.allows_others else [n[:SHOWN] for n in unknown],
        }
        for what, names in wrong.items():
            if names:
                hints = [_hint(n, unknown) * (what == "missing") for n in names]
                named = ", ".join(map(str.__add__, names, hints))
                verb = f"columns {named} are" if names[1:] else f"column {named} is"
                line = f"{path}: row 1: {verb} {what}.{self.note}"
                problems.add(f"columns {what}", line)
        return not (wrong["missing"] or wrong["there twice"])


def _hint(name: str, unknown: Sequence[str]) -> str:
    in_lower_case = {each.lower(): each[:SHOWN] for each in unknown}
    similar = get_close_matches(name, in_lower_case, n=1, cutoff=0.5)
    return f" (is it {in_lower_case[similar[0]]!r}?)" if similar else ""


@dataclass(frozen=True)
class Texts:
    """A column of texts."""

    code: Int[np.ndarray, " row"]  # index into names
    names: list[str]  # in the order in which they first appear


@dataclass(frozen=True)
class Table:
    """Columns of a table; a column with a problem in its name is left out."""

    path: Path
    line: Int[np.ndarray, " row"]  # of the file
    texts: dict[str, Texts]
    numbers: dict[str, Float[np.ndarray, " row"]]
    is_whole: bool = True  # all columns, no row left out
    row_name: str = "row {}"  # names a line in messages

    @property
    def rows(self) -> int:
        """The number of rows."""
        return len(self.line)

    @property
    def lacks_value(self) -> Bool[np.ndarray, " row"]:
        """Whether a row has a number that is not finite, or an empty text."""
        lacks = [~np.isfinite(values) for values in self.numbers.values()]
        for text in self.texts.values():
            lacks.append(~np.array([*map(bool, text.names)])[text.code])
        return np.any(lacks, axis=0)

    def where(self, row: int | np.integer) -> str:
        """Return file and row as messages name them."""
        return f"{self.path}: {self.row_name.format(self.line[row])}"

    def check(self, problems: Problems, quantity: Quantity, *names: str) -> None:
        """Add a problem if columns contain a value outside the range of a quantity."""
        for name in names:
            values = self.numbers.get(name)
            if values is None:
                continue
            outside = np.flatnonzero((values < quantity.low) | (values > quantity.high))
            if len(outside) > MOST_PROBLEMS:  # a unit is mistaken
                outside = outside[[np.argmax(np.abs(values[outside]))]]
            for row in outside:
                where = f"{self.where(row)}: {name}"
                problems.check(quantity, values[row], where, of_push=True)


def read_bytes(path: Path, *endings: str) -> bytes:
    """Return the content of a file with one of the given endings.

    Raises:
        BadTable: another ending, or the file cannot be read or is too large.
    """
    if path.suffix.lower() not in endings:
        raise BadTable(f"{path}: unsupported file type; use {' or '.join(endings)}.")
    return read_file(path, most=LARGEST, error=BadTable)


def read_csv(path: Path, data: bytes, columns: Columns, problems: Problems) -> Table:
    """Read a table from CSV; its rows are lines of the file, from 1.

    Args:
        path: named in messages.
        data: content of the file.
        columns: of the format.
        problems: to which problems of header and values are added.

    Raises:
        BadTable: the file is not CSV text or is empty.
    """
    reader = _Reader(path, columns, problems)
    try:
        text = data.decode("utf-8-sig")
        if "\0" in text:
            raise csv.Error
        separator = _separator(path, text.partition("\n")[0], problems)
        lines = csv.reader(io.StringIO(text, newline=""), delimiter=separator)
        reader.read_header([name.strip() for name in next(lines, [])])
        for fields in filter(None, lines):
            reader.read_row(lines.line_num, fields)
    except (UnicodeDecodeError, csv.Error):
        raise BadTable(f"{path}: not CSV text; save it as UTF-8 CSV.") from None
    if not reader.lines and not problems:
        raise BadTable(f"{path}: has no rows; add rows below the header.")
    return reader.table()


def _separator(path: Path, header: str, problems: Problems) -> str:
    for separator, name in _SEPARATORS.items():
        if separator in header and "," not in header:
            line = f"{path}: row 1: {name} separate the columns; use commas"
            problems.add("separator", f"{line}, and decimal points in numbers.")
            return separator
    return ","


@dataclass
class _Reader:
    """Collects the rows of a table."""

    path: Path
    columns: Columns
    problems: Problems
    header: list[str] = field(default_factory=list)
    lines: "array[int]" = field(default_factory=lambda: array("q"))
    texts: dict[str, tuple["array[int]", dict[str, int]]] = field(default_factory=dict)
    numbers: dict[str, "array[float]"] = field(default_factory=dict)
    is_whole: bool = True

    def read_header(self, header: list[str]) -> None:
        if not header:
            raise BadTable(f"{self.path}: empty; the first row names the columns.")
        self.is_whole = self.columns.check(self.path, header, self.problems)
        self.header = header
        texts = (*self.columns.texts, *self.columns.optional)
        self.texts = {name: (array("q"), {}) for name in texts if name in header}
        self.numbers = {n: array("d") for n in self.columns.numbers if n in header}

    def read_row(self, line: int, fields: list[str]) -> None:
        where = f"{self.path}: row {line}"
        lacking = len(self.header) - len(fields)
        is_cut = lacking > 0 and self._names_push(fields)
        if lacking:
            self.is_whole &= is_cut
            self.problems.add(
                "fields",
                f"{where}: has {len(fields)} fields, not {len(self.header)} as the "
                "header has; it is cut, or has decimal commas: repair or remove it.",
                of_push=is_cut,
            )
            if not is_cut:
                return
        if len(self.lines) == MOST_ROWS:
            raise BadTable(f"{self.path}: has over {MOST_ROWS} rows; split the file.")
        self.lines.append(line)
        if is_cut:
            # Its last field may be cut as well.
            fields = [*fields[:-1], *[""] * (lacking + 1)]
        row = dict(zip(self.header, fields, strict=True))
        for name, (codes, names) in self.texts.items():
            text = row[name].strip()
            if not text and not is_cut:
                is_of_push = name != self.columns.texts[0]
                self.is_whole &= is_of_push
                problem = f"{where}: {name} is empty; write its name."
                self.problems.add(f"empty {name}", problem, of_push=is_of_push)
            codes.append(names.setdefault(text, len(names)))
        for name, values in self.numbers.items():
            field = f"{where}: {name}"
            values.append(np.nan if is_cut else number(row[name], field, self.problems))

    def _names_push(self, fields: list[str]) -> bool:
        """Return whether the first text, the push, is whole in a row that is cut."""
        named = dict(zip(self.header, fields[:-1], strict=False))
        return any(named.get(name, "").strip() for name in self.columns.texts[:1])

    def table(self) -> Table:
        return Table(
            path=self.path,
            line=np.array(self.lines, np.int64),
            texts={
                name: Texts(np.array(codes, np.int64), list(names))
                for name, (codes, names) in self.texts.items()
            },
            numbers={k: np.array(v, float) for k, v in self.numbers.items()},
            is_whole=self.is_whole,
        )


def number(text: str, where: str, problems: Problems) -> float:
    """Return the finite number that a text spells; else add a problem, return NaN.

    Python also reads 1_000 and digits of other scripts; tables mean something else.
    """
    with suppress(ValueError):
        if text.isascii() and "_" not in text and np.isfinite(value := float(text)):
            return value
    remedy = "write a decimal point" if "," in text else "repair or remove the row"
    problems.add(
        f"number {where.rpartition(': ')[2]}",
        f"{where} is {text[:SHOWN]!r}; it must be a finite number: {remedy}.",
        of_push=True,
    )
    return np.nan
