"""The raw MIT Push dataset: pushes recorded over their whole duration."""

import logging
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from sainet.datasets.recorded.archives import ArchivedFile, list_files, read_files
from sainet.datasets.recorded.endpoints import SPEED
from sainet.datasets.recorded.importing import import_pushes
from sainet.datasets.recorded.motion import Unusable, read_motion
from sainet.datasets.recorded.properties import (
    CONTACT_FRICTION,
    MITPUSH_DISK,
    TABLE_FRICTION,
    Properties,
    mitpush_properties,
)
from sainet.datasets.recorded.resample import ResampledPush, resample
from sainet.datasets.store import Store
from sainet.runs.documents import content_hash, to_json
from sainet.runs.errors import BadTable
from sainet.scenes.recording import Conditions

_log = logging.getLogger(__name__)

SMALLEST = 100  # bytes: smaller files are remains of recordings that failed
ENDINGS = (".json", ".h5")  # of two files of one push, the first is taken
_OTHER_SHAPES = (
    *("ellip2", "ellip3", "rect1", "rect2", "rect3", "tri1", "tri2", "tri3"),
    *("hex", "butter"),
)
_NAME = re.compile(
    r"motion_surface=(?P<surface>[A-Za-z0-9.-]+)_shape=(?P<shape>[A-Za-z0-9.-]+)"
    r"_a=(?P<acceleration>-?\d{1,6})_v=(?P<speed>-?\d{1,6})"
    r"_(?P<place>i=-?\d+\.\d{3}_s=-?\d+\.\d{3}_t=-?\d+\.\d{3})(_rep=\d{4,})?\.(h5|json)",
    re.ASCII,
)


def import_mitpush(
    path: Path,
    out: Path,
    *,
    contact_friction: float = CONTACT_FRICTION,
    table_friction: float = TABLE_FRICTION,
) -> Store:
    """Make a store of the raw dataset: constant-speed pushes of the disk `ellip1`.

    Other files are counted by reason in `config.json` (`skipped`).

    Args:
        path: a zip (`ellip1_h5.zip`), a folder tree of zips, or a folder of .h5 or
            .json files.
        out: run folder.
        contact_friction: of pusher and disk.
        table_friction: of disk and table.

    Raises:
        BadTable: the archive is damaged or hostile, or has no push that can be used.
        MissingExtra: there are HDF5 files, and h5py is not installed.
        RunConflict: the folder holds something else.
        BadSetting: a friction is out of range.
        BadInput: the disk is full.
    """
    properties = mitpush_properties(contact_friction, table_friction)
    path, own = Path(path), Path(out).resolve()
    files = [f for f in list_files(path) if own not in f.path.resolve().parents]
    chosen, skipped = choose(files)
    pushes, digest = _read(chosen, skipped, properties)
    for reason, count in sorted(skipped.items()):
        _log.warning("%s: %d skipped: %s", path, count, reason)
    if not pushes:
        raise BadTable(f"{path}: has no push that can be used{_why(skipped)}.")
    settings = {
        "command": "import mitpush",
        "source": path.resolve().name,
        "source_sha256": digest,
        "observed": "poses during each push; velocities where they could be smoothed",
        "skipped": dict(skipped),
    }
    return import_pushes(out, settings, pushes, properties)


@dataclass(frozen=True)
class MotionFile:
    """A file of one push, and the fields of its name."""

    file: ArchivedFile
    shape: str
    acceleration: int  # mm/s^2
    conditions: Conditions  # a speed of -1 mm/s: the push accelerates
    plan: str  # surface, side, contact and direction: equal for repetitions

    @property
    def push(self) -> str:
        """The name of the push, equal for both types of file."""
        return self.file.name.rpartition(".")[0]


def choose(
    files: Sequence[ArchivedFile],
) -> tuple[list[MotionFile], Counter[str]]:
    """Return the pushes that can be modelled, by name, and counts of the others."""
    skipped: Counter[str] = Counter()
    chosen: dict[str, MotionFile] = {}
    recordings = [file for file in files if file.name.endswith(ENDINGS)]
    for file in sorted(recordings, key=_order):
        motion = _parse(file)
        reason = _reason(motion, file)
        if motion is None or reason:
            skipped[reason] += 1
        elif motion.push in chosen:
            skipped["the same push in another file"] += 1
        else:
            chosen[motion.push] = motion
    return list(chosen.values()), skipped


def _order(file: ArchivedFile) -> tuple[str, int, str]:
    stem, _, ending = file.name.rpartition(".")
    return stem, ENDINGS.index("." + ending), str(file)


def _parse(file: ArchivedFile) -> MotionFile | None:
    match = _NAME.fullmatch(file.name)
    if match is None:
        return None
    surface, speed = match["surface"], float(match["speed"])
    return MotionFile(
        file=file,
        shape=match["shape"],
        acceleration=int(match["acceleration"]),
        conditions=Conditions(surface=surface, speed_mm_s=speed),
        plan=f"{surface}_{match['place']}",
    )


def _reason(motion: MotionFile | None, file: ArchivedFile) -> str:
    """Return why a file is left out; empty if it is taken."""
    if motion is None:
        return "name differs from those of this dataset"
    if motion.shape != MITPUSH_DISK:
        known = "not a disk" if motion.shape in _OTHER_SHAPES else "unknown"
        return f"shape {motion.shape}: {known}"
    speed = motion.conditions.speed_mm_s or 0.0
    if motion.acceleration != 0 or speed <= 0:
        return "accelerated"
    if not SPEED.accepts(speed):
        return f"speed not {SPEED.wanted}"
    return "under 100 bytes" if file.size < SMALLEST else ""


def _read(
    motions: list[MotionFile], skipped: Counter[str], properties: Properties
) -> tuple[list[ResampledPush], str]:
    """Return the pushes and a hash of all files read; count unusable recordings."""
    pushes, hashes = [], {}
    contents = read_files([motion.file for motion in motions])
    for motion, (file, data) in zip(motions, contents, strict=True):
        hashes[file.name] = content_hash(data)
        try:
            recording = read_motion(
                file, data, properties, conditions=motion.conditions, plan=motion.plan
            )
            pushes.append(resample(recording))
        except Unusable as reason:
            skipped[str(reason)] += 1
            _log.warning("%s is left out: %s", file, reason)
    return pushes, content_hash(to_json(hashes).encode())


def _why(skipped: Counter[str]) -> str:
    if not skipped:
        names = f"{MITPUSH_DISK}_h5.zip, {MITPUSH_DISK}_json.zip"
        return f"; give {names} or a folder of their files"
    reasons = (f"{reason} ({count})" for reason, count in sorted(skipped.items()))
    return (
        f" (sainet models disks: constant-speed pushes of {MITPUSH_DISK}); skipped: "
        + ", ".join(reasons)
    )
