"""Recorded pushes of the MIT Push dataset: what is known of each, as plain arrays."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float

from sainet.datasets.recorded.files import read_bytes
from sainet.datasets.recorded.mitpush.disk import SPEED_RANGE
from sainet.datasets.recorded.mitpush.endpoint_csv import PLAN, Row, read_csv
from sainet.datasets.recorded.mitpush.endpoint_mat import read_mat
from sainet.runs.documents import readable
from sainet.runs.errors import BadTable

TABLE = "ellip1_endpoints.csv"
ORIGIN = (
    "the pushes are not shipped; they come from the public repository "
    "robinzhoucmu/Pushing, folder mcube_data_proc/motion_model_eval_logs"
)
_FAR = 5.0  # m: beyond the reach of the robot's arm
_MANY_TURNS = 20.0  # rad: an angle of one push is within a turn or two


@dataclass(frozen=True)
class EndpointLog:
    """Pushes along straight lines, known before and after and nowhere in between."""

    path: Path
    places: tuple[str, ...]  # that name each push in a message
    surface: tuple[str, ...]
    shape: tuple[str, ...]
    speed: Float[np.ndarray, " push"]  # m/s
    before: Float[np.ndarray, "push 3"]  # m, m, rad, in the frame of the robot's base
    after: Float[np.ndarray, "push 3"]  # m, m, rad
    tip_before: Float[np.ndarray, "push 2"]  # m, centre of the pusher
    tip_after: Float[np.ndarray, "push 2"]  # m
    published: Float[np.ndarray, "push 3"]  # m, m, rad: end by a published model
    model: str  # name of that model
    plan: tuple[tuple[str | float, ...], ...] | None  # alike of repeats, if known

    @property
    def size(self) -> int:
        """The number of pushes."""
        return len(self.places)


def find_log(path: Path) -> Path:
    """Return the file that is meant: itself, or the table in a folder.

    Raises:
        BadTable: there is none; the message says where the pushes come from.
    """
    with readable(path, BadTable):
        file = path / TABLE if path.is_dir() else path
        if not file.is_file():
            raise BadTable(f"{file}: no such file; {ORIGIN}.")
        return file


def read_log(path: Path, data: bytes | None = None) -> EndpointLog:
    """Read a table (.csv) or a log as its authors published it (.mat).

    Args:
        path: the file, or a folder that holds the table.
        data: what the file holds, where that is known already.

    Raises:
        BadTable: with the file, the row (the line of the file, from 1; or the record,
            from 0), the field and the way out.
    """
    file = find_log(path)
    data = read_bytes(file) if data is None else data
    if file.suffix.lower() == ".mat":
        places, rows, model = read_mat(file, data)
    else:
        places, rows = read_csv(file, data)
        model = "poly4"
    if not rows:
        raise BadTable(f"{file}: has no rows; fetch the file again.")
    _check_rows(file, places, rows)
    return _to_log(file, places, rows, model)


def _to_log(path: Path, places: list[str], rows: list[Row], model: str) -> EndpointLog:
    def columns(*names: str) -> np.ndarray:
        return np.array([[row[name] for name in names] for row in rows], float)

    return EndpointLog(
        path=path,
        places=tuple(places),
        surface=tuple(str(row["surface"]) for row in rows),
        shape=tuple(str(row["shape"]) for row in rows),
        speed=columns("vel_mm_s")[:, 0] / 1000,
        before=columns("obj_x0", "obj_y0", "obj_th0"),
        after=columns("obj_x1", "obj_y1", "obj_th1"),
        tip_before=columns("tip_x0", "tip_y0"),
        tip_after=columns("tip_x1", "tip_y1"),
        published=columns("zhou_poly4_x1", "zhou_poly4_y1", "zhou_poly4_th1"),
        model=f"zhou-{model}",
        plan=_plan(rows),
    )


def _plan(rows: list[Row]) -> tuple[tuple[str | float, ...], ...] | None:
    """Return surface, contact and direction as planned; a .mat log says neither."""
    if not all(name in row for row in rows for name in PLAN):
        return None
    return tuple(tuple(row[name] for name in ("surface", *PLAN)) for row in rows)


def _check_rows(path: Path, places: list[str], rows: list[Row]) -> None:
    for place, row in zip(places, rows, strict=True):
        for name, value in row.items():
            problem = _problem(name, value)
            if problem:
                raise BadTable(f"{path}: {place}: {name} is {value!r}: {problem}.")


def _problem(name: str, value: str | float) -> str:
    """Say what is wrong with a value and the way out; nothing where it is good."""
    if isinstance(value, str):
        return "" if value else "name it, or remove the row"
    if not np.isfinite(value):
        return "it must be finite; repair or remove the row"
    if name == "vel_mm_s":
        low, high = SPEED_RANGE
        wanted = f"it must be from {low:.0f} to {high:.0f} mm/s; repair the row"
        return "" if low <= value <= high else wanted
    if "_th" in name:
        small = abs(value) < _MANY_TURNS
        return "" if small else "looks like degrees; angles are in radians"
    return "" if abs(value) <= _FAR else "looks like millimetres; places are in metres"
