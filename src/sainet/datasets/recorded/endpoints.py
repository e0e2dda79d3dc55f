"""Pushes of the MIT Push dataset with poses before and after each push."""

import logging
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float

from sainet.datasets.recorded import tables
from sainet.datasets.recorded.binary import read_mat
from sainet.datasets.recorded.checks import ANGLE, PLACE, recording_problems
from sainet.datasets.recorded.importing import import_pushes
from sainet.datasets.recorded.problems import Problems
from sainet.datasets.recorded.properties import (
    CONTACT_FRICTION,
    MITPUSH_DISK,
    TABLE_FRICTION,
    Properties,
    mitpush_properties,
)
from sainet.datasets.recorded.resample import resample
from sainet.datasets.store import Store
from sainet.runs.documents import content_hash, readable
from sainet.runs.errors import BadTable
from sainet.scenes.quantities import Quantity
from sainet.scenes.recording import Conditions, Recording
from sainet.scenes.scene import TIME_STEP

_log = logging.getLogger(__name__)

TABLE = "ellip1_endpoints.csv"
ORIGIN = (
    "the pushes are not shipped; they come from the public repository "
    "robinzhoucmu/Pushing, folder mcube_data_proc/motion_model_eval_logs"
)
STROKE = 0.050  # m: recorded strokes are within 0.7 mm of it
SPEED = Quantity("speed", "mm/s", 1.0, 1000.0)  # 12,000 to 12 steps of a push
CONTACT_FRICTION_ORIGIN = (
    "default: mu in a published evaluation log of this robot (plywood, rect1), and the "
    "choice of an earlier sweep on these same pushes, so that it is no blind guess; "
    "swept from 0.15 to 0.35, the planar engine's positions are best from 0.15 to 0.2 "
    "and its rotations on abs at 0.35"
)
_ENGINES = ("planar",)
_BEFORE, _TIP = ("obj_x0", "obj_y0", "obj_th0"), ("tip_x0", "tip_y0")
_AFTER, _TIP_AFTER = ("obj_x1", "obj_y1", "obj_th1"), ("tip_x1", "tip_y1")
_PUBLISHED = ("zhou_poly4_x1", "zhou_poly4_y1", "zhou_poly4_th1")
_PLAN = ("s", "t")  # contact and direction of a push as it was planned
_POSES = (_BEFORE, _AFTER, _PUBLISHED)
COLUMNS = tables.Columns(
    texts=("surface", "shape"),
    numbers=(*_PLAN, "vel_mm_s", *_BEFORE, *_AFTER, *_TIP, *_TIP_AFTER, *_PUBLISHED),
    allows_others=True,
)


@dataclass(frozen=True)
class Endpoints:
    """Pushes along straight lines with poses before and after, none in between."""

    recordings: list[Recording]  # two samples each
    published: Float[np.ndarray, "push 3"]  # m, m, rad: end by a published model
    model: str  # name of that model


def import_endpoints(
    path: Path,
    out: Path,
    *,
    contact_friction: float = CONTACT_FRICTION,
    table_friction: float = TABLE_FRICTION,
) -> Store:
    """Make a store of pushes with known poses at both ends only.

    The pusher moves along the straight line between its recorded ends at constant
    speed; a gap or an overlap between pusher and disk stays as it was recorded.

    Args:
        path: `ellip1_endpoints.csv`, a folder with that file, or a log as its authors
            published it (`plywood_ellip1_poly4_v10.mat`).
        out: run folder.
        contact_friction: of pusher and disk. `CONTACT_FRICTION_ORIGIN`, kept in
            `config.json`, states where the default comes from.
        table_friction: of disk and table, one value for all surfaces.

    Raises:
        BadTable: the pushes cannot be used; nothing was written.
        RunConflict: the folder holds something else.
        BadSetting: a friction is out of range.
        BadInput: the disk is full.
    """
    properties = mitpush_properties(contact_friction, table_friction)
    file = find_log(Path(path))
    data = tables.read_bytes(file, ".csv", ".mat")
    found = read_endpoints(file, data, properties)
    default = contact_friction == CONTACT_FRICTION
    settings = {
        "command": "import mitpush-endpoints",
        "source": file.name,
        "source_sha256": content_hash(data),
        "observed": "poses before and after each push; no state in between",
        "contact_friction_origin": CONTACT_FRICTION_ORIGIN if default else "given",
    }
    # No pose between both ends is known, however near in time they are.
    pushes = [resample(each, longest_gap=0.0) for each in found.recordings]
    published = {found.model: found.published[:, None]}
    return import_pushes(
        out, settings, pushes, properties, engines=_ENGINES, published=published
    )


def find_log(path: Path) -> Path:
    """Return the file itself, or the table in a folder.

    Raises:
        BadTable: it does not exist; the message states where the pushes come from.
    """
    with readable(path, BadTable):
        file = path / TABLE if path.is_dir() else path
        if not file.exists():
            raise BadTable(f"{file}: no such file; {ORIGIN}.")
        return file


def read_endpoints(path: Path, data: bytes, properties: Properties) -> Endpoints:
    """Read a table (.csv) or a log as its authors published it (.mat).

    Args:
        path: named in messages.
        data: content of the file.
        properties: of disk and pusher, for checks.

    Raises:
        BadTable: with file, row (line of the file, from 1; record, from 0) and remedy;
            the first problem of each kind, one a line.
    """
    problems = Problems()
    if path.suffix.lower() == ".mat":
        table, model = read_mat(path, data, problems)
    else:
        table, model = tables.read_csv(path, data, COLUMNS, problems), "poly4"
        if not data.endswith((b"\n", b"\r")):
            _log.warning("%s: does not end in a line break; it may be truncated", path)
    _check_shapes(table, problems)
    table.check(problems, SPEED, "vel_mm_s")
    for *places, angle in _POSES:
        table.check(problems, PLACE, *places)
        table.check(problems, ANGLE, angle)
    table.check(problems, PLACE, *_TIP, *_TIP_AFTER)
    problems.raise_any()
    recordings = _recordings(table)
    for row, recording in enumerate(recordings):
        for problem in recording_problems(recording, properties):
            problems.add(problem.kind, f"{table.where(row)}: {problem.text}.")
            break  # later problems may follow from the first
    problems.raise_any()
    before = _columns(table, _BEFORE)
    published = _unwrapped(_columns(table, _PUBLISHED), before)
    return Endpoints(recordings, published, f"zhou-{model}")


def _check_shapes(table: tables.Table, problems: Problems) -> None:
    shape = table.texts.get("shape")
    for code, name in enumerate(shape.names if shape else []):
        if shape and name and name != MITPUSH_DISK:
            row = int(np.argmax(shape.code == code))
            problems.add(
                "shape",
                f"{table.where(row)}: shape is {name[: tables.SHOWN]!r}; sainet models "
                f"disks: give only pushes of {MITPUSH_DISK}.",
            )


def _columns(
    table: tables.Table, names: tuple[str, ...]
) -> Float[np.ndarray, "push column"]:
    return np.column_stack([table.numbers[name] for name in names])


def _recordings(table: tables.Table) -> list[Recording]:
    before = _columns(table, _BEFORE)
    after = _unwrapped(_columns(table, _AFTER), before)
    pose = np.stack([before, after], axis=1)[:, :, None]
    pusher = np.stack([_columns(table, _TIP), _columns(table, _TIP_AFTER)], axis=1)
    speed = table.numbers["vel_mm_s"]
    steps = np.rint(STROKE / (speed / 1000) / TIME_STEP)
    surface = table.texts["surface"]
    surfaces = [surface.names[code] for code in surface.code]
    return [
        Recording(
            time=np.array([0.0, TIME_STEP * steps[row]]),
            pose=pose[row],
            pusher=pusher[row],
            conditions=Conditions(surface=surfaces[row], speed_mm_s=float(speed[row])),
            plan=_plan(table, row, surfaces[row]),
            source=table.where(row),
        )
        for row in range(table.rows)
    ]


def _plan(table: tables.Table, row: int, surface: str) -> str:
    """Return surface, contact and direction as planned; a .mat log has neither."""
    if any(name not in table.numbers for name in _PLAN):
        return ""
    return repr((surface, *(float(table.numbers[name][row]) for name in _PLAN)))


def _unwrapped(
    pose: Float[np.ndarray, "push 3"], before: Float[np.ndarray, "push 3"]
) -> Float[np.ndarray, "push 3"]:
    """Bring angles (rad) to within half a turn of those before the push."""
    turn = np.mod(pose[:, 2] - before[:, 2] + np.pi, 2 * np.pi) - np.pi
    return np.column_stack([pose[:, :2], before[:, 2] + turn])
