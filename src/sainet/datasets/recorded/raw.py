"""The raw MIT Push dataset: pushes recorded over their whole duration."""

import io
import json
import logging
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from sainet.datasets.recorded.archives import ArchivedFile, list_files, read_files
from sainet.datasets.recorded.checks import first_fall, recording_problems
from sainet.datasets.recorded.endpoints import SPEED
from sainet.datasets.recorded.importing import import_pushes
from sainet.datasets.recorded.properties import (
    CONTACT_FRICTION,
    MITPUSH_DISK,
    TABLE_FRICTION,
    Properties,
    mitpush_properties,
)
from sainet.datasets.recorded.resample import ResampledPush, Track, resample
from sainet.datasets.store import Store
from sainet.runs.documents import content_hash, to_json
from sainet.runs.errors import BadTable, missing_extra
from sainet.scenes.recording import Conditions, Recording

_log = logging.getLogger(__name__)

SMALLEST = 100  # bytes: smaller files are remains of recordings that failed
ENDINGS = (".json", ".h5")  # of two files of one push, the first is taken
_OTHER_SHAPES = re.compile("ellip[23]|rect[123]|tri[123]|hex|butter")
_NAME = re.compile(
    r"motion_surface=(?P<surface>[A-Za-z0-9.-]+)_shape=(?P<shape>[A-Za-z0-9.-]+)"
    r"_a=(?P<acceleration>-?\d{1,6})_v=(?P<speed>-?\d{1,6})"
    r"_(?P<place>i=-?\d+\.\d{3}_s=-?\d+\.\d{3}_t=-?\d+\.\d{3})(_rep=\d{4,})?\.(h5|json)",
    re.ASCII,
)
OBJECT, TIP = "object_pose", "tip_pose"
_COLUMNS = 4  # t, x, y, yaw
_MOST_SAMPLES = 1_000_000
_LONGEST_GAP = 0.05  # s: a real turn in a longer gap may look like a marker's symmetry
_QUARTER = np.pi / 2  # rad


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


def choose(files: Sequence[ArchivedFile]) -> tuple[list[MotionFile], Counter[str]]:
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
        known = "not a disk" if _OTHER_SHAPES.fullmatch(motion.shape) else "unknown"
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
            pushes.append(resample(_read_motion(motion, data, properties)))
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


class Unusable(Exception):
    """A recording that cannot be used; the message is the reason."""


def _read_motion(motion: MotionFile, data: bytes, properties: Properties) -> Recording:
    """Return the recording of a file: samples of two clocks on one.

    Raises:
        Unusable: file or recording are damaged.
        MissingExtra: h5py is not installed.
    """
    load = _load_json if motion.file.name.endswith(".json") else _load_hdf5
    arrays = {key: _checked(key, value) for key, value in load(data).items()}
    tip, disk = (_clean(key, arrays[key]) for key in (TIP, OBJECT))
    time = np.union1d(disk.time, tip.time)
    recording = Recording(
        time=time,
        pose=_spread(disk.value, disk.time, time)[:, None],
        pusher=_spread(tip.value[:, :2], tip.time, time),
        conditions=motion.conditions,
        plan=motion.plan,
        source=str(motion.file),
    )
    for problem in recording_problems(recording, properties):
        raise Unusable(problem.kind)
    return recording


def _spread(
    value: Float[np.ndarray, "sample column"],
    own: Float[np.ndarray, " sample"],
    time: Float[np.ndarray, " moment"],
) -> Float[np.ndarray, "moment column"]:
    """Return samples at their places among all times, NaN at the others."""
    spread = np.full((len(time), value.shape[1]), np.nan)
    spread[np.searchsorted(time, own)] = value
    return spread


def _load_json(data: bytes) -> dict[str, np.ndarray]:
    try:
        content = json.loads(data)
        return {key: np.asarray(content[key]) for key in (TIP, OBJECT)}
    except (ValueError, KeyError, TypeError, RecursionError, OverflowError):
        raise Unusable("damaged, or not a recording of a push") from None


def _load_hdf5(data: bytes) -> dict[str, np.ndarray]:
    try:
        import h5py  # pyright: ignore[reportMissingImports]
    except ImportError:
        needs = "HDF5 files need the package h5py"
        instead = "give the .json files of the same pushes"
        raise missing_extra(needs, "hdf5", instead) from None
    # The HDF5 library raises arbitrary exceptions on damaged files.
    try:
        with h5py.File(io.BytesIO(data), "r") as file:
            return {key: _dataset(h5py, file, key) for key in (TIP, OBJECT)}
    except Unusable:
        raise
    except Exception:
        raise Unusable("damaged, or not a recording of a push") from None


def _dataset(h5py: Any, file: Any, key: str) -> np.ndarray:  # noqa: ANN401
    """Read an array that lies in the file itself, once its size is known."""
    link = file.get(key, getlink=True)
    if not isinstance(link, h5py.HardLink):
        raise Unusable(f"{key} is not an array of the file")
    found = file[key]
    if not isinstance(found, h5py.Dataset) or found.is_virtual or found.external:
        raise Unusable(f"{key} is not an array of the file")
    if found.dtype.kind not in "fiu" or found.size > _COLUMNS * _MOST_SAMPLES:
        raise Unusable(f"{key} is not N x 4 numbers")
    return found[()]


def _checked(key: str, value: np.ndarray) -> Float[np.ndarray, "sample 4"]:
    if value.dtype.kind not in "fiu" or value.shape[1:] != (_COLUMNS,):
        raise Unusable(f"{key} is not N x 4 numbers")
    if len(value) > _MOST_SAMPLES or not np.isfinite(value).all():
        raise Unusable(f"{key} contains NaN, infinity or too many samples")
    return value.astype(float)


def _clean(key: str, value: Float[np.ndarray, "sample 4"]) -> Track:
    """Return x, y and unwrapped yaw at increasing times."""
    new = np.diff(value[:, 0], prepend=-np.inf) != 0  # a stamp may be repeated
    time, pose = value[new, 0], value[new, 1:]
    if first_fall(time) is not None:
        raise Unusable(f"{key}: the clock runs backwards")
    if len(time) and np.diff(time).max(initial=0.0) > _LONGEST_GAP:
        raise Unusable(f"{key} has a gap of more than 50 ms")
    yaw = without_symmetry_jumps(pose[:, 2])
    return Track(time, np.column_stack([pose[:, :2], yaw]))


def without_symmetry_jumps(
    yaw: Float[np.ndarray, " sample"],
) -> Float[np.ndarray, " sample"]:
    """Undo jumps of about a quarter or half a turn between neighbours; unwrap (rad).

    Markers in a square look equal from four sides, and a tracker may switch between
    them. The rest of a jump stays, even if it is as large as an eighth of a turn.
    """
    turned = np.diff(yaw)
    left = turned - _QUARTER * np.rint(turned / _QUARTER)
    return yaw[:1] + np.concatenate([np.zeros(min(len(yaw), 1)), np.cumsum(left)])
