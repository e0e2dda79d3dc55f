"""The raw MIT Push dataset: pushes with all that was recorded of them over time."""

import logging
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Any

from sainet.datasets.recorded.arrays import (
    STORED_ENGINES,
    SceneProperties,
    write_pushes,
)
from sainet.datasets.recorded.files import list_files, read_files
from sainet.datasets.recorded.folder import make_once, partial_folders
from sainet.datasets.recorded.frictions import (
    CONTACT_FRICTION,
    TABLE_FRICTION,
    check_frictions,
)
from sainet.datasets.recorded.mitpush.disk import DISK, MASS, PUSHER_RADIUS, RADIUS
from sainet.datasets.recorded.mitpush.motion import read_motion
from sainet.datasets.recorded.mitpush.names import MotionFile, choose
from sainet.datasets.recorded.push import RecordedPush, Unusable
from sainet.datasets.store import Store
from sainet.runs.documents import content_hash, to_json
from sainet.runs.errors import BadTable

_log = logging.getLogger(__name__)


def import_mitpush(
    path: Path,
    out: Path,
    *,
    contact_friction: float = CONTACT_FRICTION,
    table_friction: float = TABLE_FRICTION,
) -> Store:
    """Make a store of the raw dataset: constant-speed pushes of the disk `ellip1`.

    What is left out is counted by its reason in `config.json` (`skipped`).

    Args:
        path: a zip (`ellip1_h5.zip`), a folder tree of them, or a folder of .h5 or
            .json files.
        out: the run folder; it appears when the store is whole and not before.
        contact_friction: between pusher and disk.
        table_friction: between disk and table.

    Raises:
        BadTable: the archive is damaged or hostile, or holds no push of use.
        MissingExtra: there are HDF5 files, and h5py is not installed.
        RunConflict: the folder holds something else; nothing was touched.
        BadInput: a friction is negative or no number, or the disk is full.
    """
    check_frictions(contact_friction, table_friction)
    path, own = Path(path), _written_below(Path(path), Path(out))
    files = [f for f in list_files(path) if own.isdisjoint(f.path.resolve().parents)]
    motions, skipped = choose(files)
    pushes, digest = _read(motions, skipped)
    for reason, count in sorted(skipped.items()):
        _log.warning("%s: %d skipped: %s", path, count, reason)
    if not pushes:
        raise BadTable(f"{path}: holds no push to use{_why(skipped)}.")
    scene = SceneProperties(
        mass=(MASS,),
        radius=(RADIUS,),
        pusher_radius=PUSHER_RADIUS,
        contact_friction=contact_friction,
        table_friction=table_friction,
    )
    config = _config(path, digest, skipped, scene)
    return make_once(
        Path(out), config, lambda folder: write_pushes(folder, pushes, scene)
    )


def _written_below(path: Path, out: Path) -> set[Path]:
    """Return the folders below `path` in which imports to `out` keep files."""
    own = {out.resolve(), *partial_folders(out)}
    return {folder for folder in own if path.resolve() in folder.parents}


def _read(
    motions: list[MotionFile], skipped: Counter[str]
) -> tuple[list[RecordedPush], str]:
    """Return the pushes and a hash of all that was read; count what is unusable."""
    pushes, hashes = [], {}
    contents = read_files([motion.file for motion in motions])
    for motion, (file, data) in zip(motions, contents, strict=True):
        hashes[file.name] = content_hash(data)
        try:
            push = read_motion(file.name, data, motion.group)
            pushes.append(replace(push, name=str(file), plan=motion.plan))
        except Unusable as reason:
            skipped[str(reason)] += 1
            _log.warning("%s is left out: %s", file, reason)
    return pushes, content_hash(to_json(hashes).encode())


def _why(skipped: Counter[str]) -> str:
    if not skipped:
        return f"; give {DISK}_h5.zip, {DISK}_json.zip or a folder of their files"
    reasons = (f"{reason} ({count})" for reason, count in sorted(skipped.items()))
    return (
        f" (sainet models disks: constant-speed pushes of {DISK}); skipped: "
        + ", ".join(reasons)
    )


def _config(
    path: Path, digest: str, skipped: Counter[str], scene: SceneProperties
) -> dict[str, Any]:
    """Return what decides the store: a changed file is a changed setting."""
    return {
        "command": "import mitpush",
        "source": path.resolve().name,
        "source_sha256": digest,
        "observed": "poses all along each push; rates where they could be smoothed",
        "skipped": dict(skipped),
        "assumed_engines": list(STORED_ENGINES),
        **scene.to_dict(),
    }
