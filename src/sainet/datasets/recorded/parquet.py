"""Tables of recorded pushes from Parquet files."""

import io
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from sainet.datasets.recorded.tables import MOST_ROWS, Columns, Problems, Table, Texts
from sainet.runs.errors import BadTable, MissingExtra


def read_parquet(
    path: Path, data: bytes, columns: Columns, problems: Problems
) -> Table:
    """Read a table from Parquet; its rows are counted from 1.

    Args:
        path: named in messages.
        data: content of the file.
        columns: of the format.
        problems: to which problems of header and values are added.

    Raises:
        BadTable: the file is damaged, not a Parquet file, or has no rows.
        MissingExtra: pyarrow is not installed.
    """
    content = _load(path, data, columns, problems)
    if not content.num_rows and not problems:
        raise BadTable(f"{path}: has no rows; write a row for each sample.")
    reader = _Reader(path, problems)
    names = content.column_names
    texts = [n for n in (*columns.texts, *columns.optional) if n in names]
    read = {name: reader.texts(name, content.column(name)) for name in texts}
    named = [name for name in columns.numbers if name in names]
    numbers = {name: reader.numbers(name, content.column(name)) for name in named}
    found_texts = {name: text for name, text in read.items() if text}
    found_numbers = {name: values for name, values in numbers.items() if len(values)}
    return Table(
        path=path,
        line=np.arange(1, content.num_rows + 1),
        texts=found_texts,
        numbers=found_numbers,
        is_whole={*columns.wanted, *texts} <= {*found_texts, *found_numbers},
    )


def _load(path: Path, data: bytes, columns: Columns, problems: Problems) -> Any:  # noqa: ANN401
    try:
        from pyarrow import parquet  # pyright: ignore[reportMissingImports]
    except ImportError:
        raise MissingExtra(
            'Parquet needs the package pyarrow: pip install "sainet[table]"; '
            "without it give the table as .csv."
        ) from None
    # Arrow raises arbitrary exceptions on damaged files.
    try:
        file = parquet.ParquetFile(io.BytesIO(data))
        header = file.schema_arrow.names
        rows = file.metadata.num_rows
        if rows > MOST_ROWS:
            raise BadTable(f"{path}: has over {MOST_ROWS} rows; split the file.")
        columns.check(path, header, problems)
        if len(set(header)) < len(header):
            problems.raise_any()
        # Codes instead of texts: a small file may repeat a long text at will.
        fields = [field for field in file.schema_arrow if field.name in columns.texts]
        texts = [field.name for field in fields if str(field.type).endswith("string")]
        wanted = [n for n in (*columns.wanted, *columns.optional) if n in header]
        return parquet.read_table(
            io.BytesIO(data), columns=wanted, read_dictionary=texts
        )
    except BadTable:
        raise
    except Exception as error:
        reason = (str(error) or type(error).__name__).partition("\n")[0][:100]
        raise BadTable(
            f"{path}: damaged or not a Parquet file ({reason}); write it again."
        ) from None


class _Reader:
    """Converts columns; adds what cannot be converted to the problems."""

    def __init__(self, path: Path, problems: Problems) -> None:
        self._path, self._problems = path, problems

    def numbers(self, name: str, column: Any) -> Float[np.ndarray, " row"]:  # noqa: ANN401
        """Return a column of numbers; empty if it contains something else."""
        import pyarrow as pa  # pyright: ignore[reportMissingImports]

        kind = column.type
        if not (pa.types.is_floating(kind) or pa.types.is_integer(kind)):
            self._bad(name, f"column {name} contains {kind}, not numbers; convert it.")
            return np.zeros(0)
        values = column.cast(pa.float64(), safe=False).to_numpy(zero_copy_only=False)
        wrong = np.flatnonzero(~np.isfinite(values))
        if len(wrong):
            row, value = wrong[0] + 1, values[wrong[0]]
            self._bad(
                name,
                f"row {row}: {name} is {value}; it must be a finite number: repair or "
                "remove the row.",
            )
        return np.where(np.isfinite(values), values, np.nan).astype(float)

    def texts(self, name: str, column: Any) -> Texts | None:  # noqa: ANN401
        """Return a column of texts; None if it has another type or an empty text."""
        import pyarrow as pa  # pyright: ignore[reportMissingImports]

        try:
            if not pa.types.is_dictionary(column.type):
                column = column.cast(pa.string()).dictionary_encode()
            column = column.unify_dictionaries().combine_chunks()
            texts = column.dictionary.cast(pa.string()).to_pylist()
        except pa.ArrowException:
            kind = column.type
            self._bad(name, f"column {name} contains {kind}, not text; convert it.")
            return None
        names = [(text or "").strip() for text in texts]
        codes = column.indices.fill_null(-1).to_numpy(zero_copy_only=False)
        empty = (codes < 0) | ~np.array([*map(bool, names), False])[codes]
        if empty.any():
            row = int(np.argmax(empty)) + 1
            self._bad(name, f"row {row}: {name} is empty; write its name.")
            return None
        used, first = np.unique(codes, return_index=True)
        order = dict.fromkeys(names[code] for code in used[np.argsort(first)])
        place = {text: index for index, text in enumerate(order)}
        code = np.array([place.get(text, -1) for text in names], np.int64)[codes]
        return Texts(code, list(order))

    def _bad(self, name: str, problem: str) -> None:
        self._problems.add(f"column {name}", f"{self._path}: {problem}")
