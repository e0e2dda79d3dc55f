"""Tables in binary files: Parquet, and logs of the MIT Push dataset (.mat)."""

import io
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from sainet.datasets.recorded.problems import Problems
from sainet.datasets.recorded.tables import MOST_ROWS, SHOWN, Columns, Table, Texts
from sainet.datasets.schema import Arrays
from sainet.runs.errors import BadTable, missing_extra


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
    content = _load_parquet(path, data, columns, problems)
    if not content.num_rows and not problems:
        raise BadTable(f"{path}: has no rows; write a row for each sample.")
    reader = _Converter(path, problems)
    names = content.column_names
    texts = [n for n in (*columns.texts, *columns.optional) if n in names]
    read = {
        name: reader.texts(name, content.column(name), of_push=name != columns.texts[0])
        for name in texts
    }
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


@contextmanager
def _decoding(path: Path, kind: str, remedy: str) -> Iterator[None]:
    """Raise `BadTable` for the arbitrary exceptions of readers on damaged files."""
    try:
        yield
    except BadTable:
        raise
    except Exception as error:
        reason = (str(error) or type(error).__name__).partition("\n")[0][:100]
        damage = f"damaged or not a {kind} file ({reason})"
        raise BadTable(f"{path}: {damage}; {remedy}.") from None


def _load_parquet(path: Path, data: bytes, columns: Columns, problems: Problems) -> Any:  # noqa: ANN401
    try:
        from pyarrow import parquet  # pyright: ignore[reportMissingImports]
    except ImportError:
        needs = "Parquet needs the package pyarrow"
        raise missing_extra(needs, "table", "give the table as .csv") from None
    with _decoding(path, "Parquet", "write it again"):
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


class _Converter:
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
        for row in wrong:
            text = f"row {row + 1}: {name} is {values[row]}; it must be a finite number"
            line = f"{self._path}: {text}: repair or remove the row."
            self._problems.add(f"column {name}", line, of_push=True)
        return np.where(np.isfinite(values), values, np.nan).astype(float)

    def texts(self, name: str, column: Any, *, of_push: bool) -> Texts | None:  # noqa: ANN401
        """Return a column of texts; None if it has another type.

        Args:
            name: of the column.
            column: of pyarrow.
            of_push: whether an empty text costs only its push; else None is returned.
        """
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
        names = [*((text or "").strip() for text in texts), ""]  # the last one: null
        codes = column.indices.fill_null(-1).to_numpy(zero_copy_only=False)
        empty = np.flatnonzero(~np.array([*map(bool, names)])[codes])
        for row in empty:
            line = f"{self._path}: row {row + 1}: {name} is empty; write its name."
            self._problems.add(f"empty {name}", line, of_push=of_push)
        if len(empty) and not of_push:
            return None
        used, first = np.unique(codes, return_index=True)
        order = dict.fromkeys(names[code] for code in used[np.argsort(first)])
        place = {text: index for index, text in enumerate(order)}
        code = np.array([place.get(text, -1) for text in names])[codes]
        return Texts(code, list(order))

    def _bad(self, name: str, problem: str) -> None:
        self._problems.add(f"column {name}", f"{self._path}: {problem}")


# Fields of a record, and the columns of the CSV table with the same content.
FIELDS = {
    "init_pose_gt": ("obj_x0", "obj_y0", "obj_th0"),
    "final_pose_gt": ("obj_x1", "obj_y1", "obj_th1"),
    "final_pose_sim": ("zhou_poly4_x1", "zhou_poly4_y1", "zhou_poly4_th1"),
    "init_tip_pt": ("tip_x0", "tip_y0"),
    "final_tip_pt": ("tip_x1", "tip_y1"),
}
_NAME = re.compile(
    r"(?P<surface>[^_]+)_(?P<shape>[^_]+)_(?P<model>.+)_v(?P<speed>\d+(\.\d+)?)\.mat",
    re.ASCII,
)
# Fields of a log that repeat a part of its name.
_INSIDE = {
    "surface": "surface_type",
    "shape": "shape_id",
    "model": "ls_type",
    "speed": "vel",
}


def read_mat(path: Path, data: bytes, problems: Problems) -> tuple[Table, str]:
    """Return the records as the table of endpoints, and the name of the model.

    Args:
        path: its name contains surface, shape, model and speed (mm/s).
        data: content of the file.
        problems: to which values that are not finite are added.

    Raises:
        BadTable: name or content are not those of such a log.
    """
    match = _NAME.fullmatch(path.name)
    if match is None:
        raise BadTable(
            f"{path}: the name must be SURFACE_SHAPE_MODEL_vSPEED.mat, as in "
            "plywood_ellip1_poly4_v10.mat; restore the original name."
        )
    content = _load_mat(path, data)
    _check_name(path, match.groupdict(), content)
    if "record_all" not in content:
        raise BadTable(f"{path}: record_all is missing; give an evaluation log.")
    records = np.ravel(content["record_all"])
    rows = [_row(path, index, record) for index, record in enumerate(records)]
    if not rows:
        raise BadTable(f"{path}: has no rows; download the file again.")
    columns = {name: np.array([row[name] for row in rows]) for name in rows[0]}
    columns["vel_mm_s"] = np.full(len(rows), float(match["speed"]))
    for name, values in columns.items():
        wrong = np.flatnonzero(~np.isfinite(values))
        if len(wrong):
            where = f"{path}: record_all[{wrong[0]}]: {name}"
            line = f"{where} is {values[wrong[0]]}; it must be a finite number."
            problems.add(f"number {name}", line)
    same = np.zeros(len(rows), np.int64)
    table = Table(
        path=path,
        line=np.arange(len(rows)),
        texts={name: Texts(same, [match[name]]) for name in ("surface", "shape")},
        numbers=columns,
        row_name="record_all[{}]",
    )
    return table, match["model"]


def _load_mat(path: Path, data: bytes) -> Arrays:
    from scipy.io import loadmat

    names = ["record_all", *_INSIDE.values()]
    with _decoding(path, "MATLAB", "download it again"):
        found = loadmat(io.BytesIO(data), variable_names=names)
        return {name: found[name] for name in names if name in found}


def _check_name(
    path: Path, named: dict[str, str], content: dict[str, np.ndarray]
) -> None:
    """Refuse a renamed log: a square would be read as a disk."""
    for part, field in _INSIDE.items():
        if field not in content or np.size(content[field]) != 1:
            continue
        inside = np.squeeze(_unwrap(content[field]))
        wanted = float(named[part]) if part == "speed" else named[part]
        if not np.array_equal(inside, wanted):
            raise BadTable(
                f"{path}: {field} is {str(inside)[:SHOWN]!r} inside and "
                f"{named[part]!r} by its name; restore the original name."
            )


def _row(path: Path, index: int, record: Any) -> dict[str, float]:  # noqa: ANN401
    """Return one record, a structure in nested cells."""
    record = _unwrap(record)
    row: dict[str, float] = {}
    for field, columns in FIELDS.items():
        where = f"{path}: record_all[{index}]: {field}"
        if field not in (getattr(record, "dtype", np.dtype(float)).names or ()):
            raise BadTable(f"{where} is missing; download the log again.")
        values = np.ravel(_unwrap(record[field]))
        if values.shape != (len(columns),) or values.dtype.kind not in "fiu":
            wanted = f"{len(columns)} real numbers"
            raise BadTable(f"{where} must be {wanted}; download the log again.")
        row |= dict(zip(columns, values.astype(float).tolist(), strict=True))
    return row


def _unwrap(value: Any) -> Any:  # noqa: ANN401
    while isinstance(value, np.ndarray) and value.dtype.hasobject and value.size == 1:
        inner = value.item() if value.dtype == object else value.ravel()[0]
        if inner is value:
            break
        value = inner
    return value
