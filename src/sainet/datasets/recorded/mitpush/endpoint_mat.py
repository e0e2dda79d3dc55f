"""Reading an evaluation log of the recorded pushes as its authors published it."""

import io
import re
from pathlib import Path
from typing import Any

import numpy as np

from sainet.datasets.recorded.mitpush.endpoint_csv import Row
from sainet.runs.errors import BadTable

# Each field of a record, and the columns of the table that say the same.
FIELDS = {
    "init_pose_gt": ("obj_x0", "obj_y0", "obj_th0"),
    "final_pose_gt": ("obj_x1", "obj_y1", "obj_th1"),
    "final_pose_sim": ("zhou_poly4_x1", "zhou_poly4_y1", "zhou_poly4_th1"),
    "init_tip_pt": ("tip_x0", "tip_y0"),
    "final_tip_pt": ("tip_x1", "tip_y1"),
}
_NAME = re.compile(
    r"(?P<surface>[^_]+)_(?P<shape>[^_]+)_(?P<model>.+)_v(?P<speed>\d+(\.\d+)?)\.mat"
)
# What the log itself says of these, where it does.
_INSIDE = {
    "surface": "surface_type",
    "shape": "shape_id",
    "model": "ls_type",
    "speed": "vel",
}


def read_mat(path: Path, data: bytes) -> tuple[list[str], list[Row], str]:
    """Return what names each record, the records as rows of the table, and the model.

    Args:
        path: its name carries surface, shape, model and speed (mm/s).
        data: what the file holds.

    Raises:
        BadTable: the name or the content is not that of such a log.
    """
    match = _NAME.fullmatch(path.name)
    if match is None:
        raise BadTable(
            f"{path}: the name must be SURFACE_SHAPE_MODEL_vSPEED.mat, as in "
            "plywood_ellip1_poly4_v10.mat; give the log its own name back."
        )
    content = _load(path, data)
    _check_name(path, match.groupdict(), content)
    if "record_all" not in content:
        raise BadTable(f"{path}: record_all is missing; give an evaluation log.")
    records = np.ravel(content["record_all"])
    places = [f"record_all[{index}]" for index in range(len(records))]
    common: Row = {"surface": match["surface"], "shape": match["shape"]}
    common["vel_mm_s"] = float(match["speed"])
    rows = [
        common | _row(path, place, record)
        for place, record in zip(places, records, strict=True)
    ]
    return places, rows, match["model"]


def _load(path: Path, data: bytes) -> dict[str, Any]:
    from scipy.io import loadmat

    names = ["record_all", *_INSIDE.values()]
    try:
        return loadmat(io.BytesIO(data), variable_names=names)
    # Of a damaged file SciPy's reader raises whatever it stumbles over.
    except Exception as error:
        reason = str(error).partition("\n")[0] or type(error).__name__
        raise BadTable(
            f"{path}: is damaged or no MATLAB file ({reason}); fetch it again."
        ) from None


def _check_name(path: Path, named: dict[str, str], content: dict[str, Any]) -> None:
    """A square renamed to a disk would pass for one."""
    for part, field in _INSIDE.items():
        if field not in content or np.size(content[field]) != 1:
            continue
        inside = np.squeeze(_unwrap(content[field]))
        wanted = float(named[part]) if part == "speed" else named[part]
        if not np.array_equal(inside, wanted):
            raise BadTable(
                f"{path}: {field} is {str(inside)[:40]!r} inside and {named[part]!r} "
                "by its name; give the log its own name back."
            )


def _row(path: Path, place: str, record: Any) -> Row:  # noqa: ANN401
    """Return one record, a structure inside whatever cells it is wrapped in."""
    record = _unwrap(record)
    row: Row = {}
    for field, columns in FIELDS.items():
        if field not in (getattr(record, "dtype", np.dtype(float)).names or ()):
            raise BadTable(f"{path}: {place}: {field} is missing; fetch the log again.")
        values = np.ravel(_unwrap(record[field]))
        if values.shape != (len(columns),) or values.dtype.kind not in "fiu":
            raise BadTable(
                f"{path}: {place}: {field} must be {len(columns)} real numbers; "
                "fetch the log again."
            )
        row |= dict(zip(columns, values.astype(float).tolist(), strict=True))
    return row


def _unwrap(value: Any) -> Any:  # noqa: ANN401
    while isinstance(value, np.ndarray) and value.dtype.hasobject and value.size == 1:
        inner = value.item() if value.dtype == object else value.ravel()[0]
        if inner is value:
            break
        value = inner
    return value
