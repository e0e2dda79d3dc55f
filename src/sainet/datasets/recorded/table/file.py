"""A file that holds a table of pushes: CSV or Parquet."""

from pathlib import Path

from sainet.datasets.recorded.files import read_bytes
from sainet.datasets.recorded.table.csv_rows import read_csv
from sainet.datasets.recorded.table.rows import TableRows
from sainet.runs.documents import readable
from sainet.runs.errors import BadTable

LARGEST = 1 << 30  # bytes


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
        from sainet.datasets.recorded.table.parquet_rows import read_parquet

        rows = read_parquet(path, data)
    else:
        rows = read_csv(path, data)
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
    with readable(path, BadTable):
        if path.is_file() and path.stat().st_size > LARGEST:
            raise BadTable(f"{path}: has over {LARGEST >> 30} GB; split it by pushes.")
    return read_bytes(path)
