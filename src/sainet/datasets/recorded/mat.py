"""Evaluation logs of the MIT Push dataset as their authors published them (.mat)."""

import io
import re
from pathlib import Path
from typing import Any

import numpy as np

from sainet.datasets.recorded.tables import SHOWN, Problems, Table, Texts
from sainet.datasets.schema import Arrays
from sainet.runs.errors import BadTable

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
    content = _load(path, data)
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


def _load(path: Path, data: bytes) -> Arrays:
    from scipy.io import loadmat

    names = ["record_all", *_INSIDE.values()]
    # SciPy's reader raises arbitrary exceptions on damaged files.
    try:
        found = loadmat(io.BytesIO(data), variable_names=names)
        return {name: found[name] for name in names if name in found}
    except Exception as error:
        reason = (str(error) or type(error).__name__).partition("\n")[0][:100]
        raise BadTable(
            f"{path}: damaged or not a MATLAB file ({reason}); download it again."
        ) from None


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
