"""A table of pushes as columns, from Parquet."""

import io
from pathlib import Path
from typing import Any

import numpy as np

from sainet.datasets.recorded.table.rows import (
    GROUP,
    MOST_ROWS,
    NUMBERS,
    TEXT,
    TableRows,
    check_header,
)
from sainet.runs.errors import BadTable, MissingExtra


def read_parquet(path: Path, data: bytes) -> TableRows:
    """Read a table; its rows are counted from 1.

    Args:
        path: to name in messages.
        data: what the file holds.

    Raises:
        BadTable: the file is damaged or no such table.
        MissingExtra: pyarrow is not installed.
    """
    table = _load(path, data)
    line = np.arange(1, table.num_rows + 1)
    values = [_numbers(path, name, table.column(name)) for name in NUMBERS]
    known = [name for name in (*TEXT, GROUP) if name in table.column_names]
    texts = {name: _codes(path, name, table.column(name)) for name in known}
    return TableRows(
        path=path,
        line=line,
        codes={name: codes for name, (codes, _) in texts.items()},
        names={name: names for name, (_, names) in texts.items()},
        values=np.column_stack(values),
    )


def _load(path: Path, data: bytes) -> Any:  # noqa: ANN401
    try:
        from pyarrow import parquet  # pyright: ignore[reportMissingImports]
    except ImportError:
        raise MissingExtra(
            'Parquet needs the package pyarrow: pip install "sainet[table]"; '
            "without it give the table as .csv."
        ) from None
    # Of a damaged file Arrow raises whatever it stumbles over.
    try:
        file = parquet.ParquetFile(io.BytesIO(data))
        check_header(path, file.schema_arrow.names)
        if file.metadata.num_rows > MOST_ROWS:
            raise BadTable(f"{path}: has over {MOST_ROWS} rows; split it by pushes.")
        # They stay codes: a small file may hold any number of copies of a long text.
        fields = [field for field in file.schema_arrow if field.name not in NUMBERS]
        texts = [field.name for field in fields if str(field.type).endswith("string")]
        return parquet.read_table(io.BytesIO(data), read_dictionary=texts)
    except BadTable:
        raise
    except Exception as error:
        reason = (str(error) or type(error).__name__).partition("\n")[0][:200]
        raise BadTable(
            f"{path}: is damaged or no Parquet file ({reason}); write it again."
        ) from None


def _numbers(path: Path, name: str, column: Any) -> np.ndarray:  # noqa: ANN401
    import pyarrow as pa  # pyright: ignore[reportMissingImports]

    kind = column.type
    if not (pa.types.is_floating(kind) or pa.types.is_integer(kind)):
        raise BadTable(f"{path}: column {name} holds {kind}, not numbers; convert it.")
    values = column.cast(pa.float64(), safe=False).to_numpy(zero_copy_only=False)
    wrong = np.flatnonzero(~np.isfinite(values))
    if len(wrong):
        raise BadTable(
            f"{path}: row {wrong[0] + 1}: {name} is {values[wrong[0]]}; it must be "
            "finite; repair or remove the row."
        )
    return np.asarray(values, float)


def _codes(path: Path, name: str, column: Any) -> tuple[np.ndarray, list[str]]:  # noqa: ANN401
    """Return each text as a code, and the texts in the order of their first use."""
    import pyarrow as pa  # pyright: ignore[reportMissingImports]

    try:
        if not pa.types.is_dictionary(column.type):
            column = column.cast(pa.string()).dictionary_encode()
        column = column.unify_dictionaries().combine_chunks()
        texts = column.dictionary.cast(pa.string()).to_pylist()
    except pa.ArrowException:
        raise BadTable(
            f"{path}: column {name} holds {column.type}, not text; convert it."
        ) from None
    names = [(text or "").strip() for text in texts]
    codes = column.indices.fill_null(-1).to_numpy(zero_copy_only=False)
    empty = np.flatnonzero((codes < 0) | ~np.array([*map(bool, names), False])[codes])
    if len(empty):
        raise BadTable(f"{path}: row {empty[0] + 1}: {name} is empty; name it.")
    used, first = np.unique(codes, return_index=True)
    order = dict.fromkeys(names[code] for code in used[np.argsort(first)])
    place = {text: index for index, text in enumerate(order)}
    return np.array([place.get(text, -1) for text in names])[codes], list(order)
