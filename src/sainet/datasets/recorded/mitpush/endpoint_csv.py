"""Reading the table of recorded pushes: one row a push, columns in any order."""

import csv
import io
import logging
from collections.abc import Iterator
from pathlib import Path

from sainet.runs.errors import BadTable

_log = logging.getLogger(__name__)

TEXT = ("surface", "shape")
PLAN = ("s", "t")  # contact and direction of a push as it was planned
NUMBERS = (
    *("vel_mm_s", "obj_x0", "obj_y0", "obj_th0", "obj_x1", "obj_y1", "obj_th1"),
    *("tip_x0", "tip_y0", "tip_x1", "tip_y1"),
    *("zhou_poly4_x1", "zhou_poly4_y1", "zhou_poly4_th1"),
)
Row = dict[str, str | float]


def read_csv(path: Path, data: bytes) -> tuple[list[str], list[Row]]:
    """Return what names each row in a message, and the rows, in the file's units.

    Args:
        path: to name in messages.
        data: what the file holds.

    Raises:
        BadTable: the file is no such table, or a row of it is cut or no numbers.
    """
    try:
        reader = csv.reader(io.StringIO(data.decode("utf-8-sig"), newline=""))
        lines = [(reader.line_num, fields) for fields in reader if fields]
    except (UnicodeDecodeError, csv.Error):
        raise BadTable(
            f"{path}: is no CSV text; give ellip1_endpoints.csv or a .mat log."
        ) from None
    if not lines:
        raise BadTable(f"{path}: is empty; fetch the file again.")
    if not data.endswith((b"\n", b"\r")):
        _log.warning("%s: no line break at its end; is the last row whole?", path)
    (_, header), *body = lines
    _check_header(path, header)
    places = [f"row {number}" for number, _ in body]
    return places, list(_rows(path, header, places, [fields for _, fields in body]))


def _check_header(path: Path, header: list[str]) -> None:
    for name in (*TEXT, *PLAN, *NUMBERS):
        if header.count(name) != 1:
            found = "missing" if name not in header else "there twice"
            raise BadTable(
                f"{path}: row 1: column {name} is {found}; it is one of the columns "
                "that a table of recorded pushes needs once."
            )


def _rows(
    path: Path, header: list[str], places: list[str], body: list[list[str]]
) -> Iterator[Row]:
    for place, fields in zip(places, body, strict=True):
        if len(fields) != len(header):
            raise BadTable(
                f"{path}: {place}: has {len(fields)} fields, not {len(header)} as the "
                "header has; it is cut or broken: repair or remove it."
            )
        text = dict(zip(header, fields, strict=True))
        numbers = {
            name: _number(path, place, name, text[name]) for name in (*PLAN, *NUMBERS)
        }
        yield {name: text[name].strip() for name in TEXT} | numbers


def _number(path: Path, place: str, name: str, text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise BadTable(
            f"{path}: {place}: {name} is {text[:40]!r}, which is no number; "
            "repair or remove the row."
        ) from None
