"""Recorded pushes of the MIT Push dataset as a store of the same schema as any other.

The disk `ellip1` is the one that the paper's robot pushes. Its state is known before
and after each push; in between nothing was observed, and the store says so.
"""

from pathlib import Path
from typing import Any

from sainet.datasets.recorded.files import read_bytes
from sainet.datasets.recorded.folder import make_once
from sainet.datasets.recorded.frictions import (
    CONTACT_FRICTION,
    TABLE_FRICTION,
    check_frictions,
)
from sainet.datasets.recorded.mitpush.disk import DISK, NO_DISKS
from sainet.datasets.recorded.mitpush.endpoint_arrays import (
    ASSUMED_ENGINE,
    store_info,
    to_arrays,
)
from sainet.datasets.recorded.mitpush.endpoint_log import (
    EndpointLog,
    find_log,
    read_log,
)
from sainet.datasets.store import Store
from sainet.datasets.writer import write_store
from sainet.runs.documents import content_hash
from sainet.runs.errors import BadTable

CONTACT_FRICTION_ORIGIN = (
    "default: mu in a published evaluation log of this robot (plywood, rect1), and the "
    "choice of an earlier sweep on these same pushes, so that it is no blind guess; "
    "swept from 0.15 to 0.35, the planar engine's positions are best from 0.15 to 0.2 "
    "and its rotations on abs at 0.35"
)


def import_endpoints(
    path: Path,
    out: Path,
    *,
    contact_friction: float = CONTACT_FRICTION,
    table_friction: float = TABLE_FRICTION,
) -> Store:
    """Make a store of pushes that are known at their two ends alone.

    The pusher goes along the straight line between its recorded ends at constant
    speed: a nominal stroke of 50 mm at 10 or 20 mm/s is 1,200 or 600 steps. A gap or
    overlap between pusher and disk at the start stays as it was recorded.

    Args:
        path: `ellip1_endpoints.csv`, a folder that holds it, or a log as its authors
            published it (`plywood_ellip1_poly4_v10.mat`).
        out: the run folder; it appears when the store is whole and not before.
        contact_friction: between pusher and disk. The default is `mu` in a published
            evaluation log, and what an earlier sweep on these same pushes chose: it is
            no blind guess (`CONTACT_FRICTION_ORIGIN`, kept in `config.json`).
        table_friction: between disk and table, of one value for all surfaces.

    Raises:
        BadTable: the pushes cannot be read; nothing was written.
        RunConflict: the folder holds something else; nothing was touched.
        BadInput: a friction is negative or no number, or the disk is full.
    """
    check_frictions(contact_friction, table_friction)
    file = find_log(Path(path))
    data = read_bytes(file)
    log = read_log(file, data)
    _check_shapes(log)
    config = _config(file.name, data, contact_friction, table_friction)

    def write(folder: Path) -> None:
        info = store_info(log)
        arrays = to_arrays(log, info, contact_friction, table_friction)
        write_store(folder, info, arrays)

    return make_once(Path(out), config, write)


def _config(
    source: str, data: bytes, contact_friction: float, table_friction: float
) -> dict[str, Any]:
    """Return what decides the store: a changed file is a changed setting."""
    default = contact_friction == CONTACT_FRICTION
    return {
        "command": "import mitpush-endpoints",
        "source": source,
        "source_sha256": content_hash(data),
        "observed": "poses before and after each push; no state in between",
        "contact_friction": float(contact_friction),
        "contact_friction_origin": CONTACT_FRICTION_ORIGIN if default else "given",
        "table_friction": float(table_friction),
        "assumed_engine": ASSUMED_ENGINE,
    }


def _check_shapes(log: EndpointLog) -> None:
    for place, shape in zip(log.places, log.shape, strict=True):
        if shape in NO_DISKS:
            reason = f"sainet models disks; {shape} is none"
        else:
            reason = f"unknown shape; the disk of these pushes is {DISK}"
        if shape != DISK:
            raise BadTable(
                f"{log.path}: {place}: shape is {shape!r}: {reason}. "
                f"Give pushes of {DISK} alone."
            )
