"""One file of the raw MIT Push dataset: read, and its known defects repaired."""

import io
import json
from typing import Any

import numpy as np
from jaxtyping import Float

from sainet.datasets.recorded.archives import ArchivedFile
from sainet.datasets.recorded.checks import first_fall, recording_problems
from sainet.datasets.recorded.properties import Properties
from sainet.datasets.recorded.resample import Track
from sainet.runs.errors import MissingExtra
from sainet.scenes.recording import Conditions, Recording

OBJECT, TIP = "object_pose", "tip_pose"
_COLUMNS = 4  # t, x, y, yaw
_MOST_SAMPLES = 1_000_000
_LONGEST_GAP = 0.05  # s: a real turn in a longer gap may look like a marker's symmetry
_QUARTER = np.pi / 2  # rad


class Unusable(Exception):
    """A recording that cannot be used; the message is the reason."""


def read_motion(
    file: ArchivedFile,
    data: bytes,
    properties: Properties,
    *,
    conditions: Conditions,
    plan: str,
) -> Recording:
    """Return the recording of a file: samples of two clocks on one.

    Args:
        file: its ending states the format of the data.
        data: content of the file.
        properties: of disk and pusher, for checks.
        conditions: of the recording.
        plan: of the recording.

    Raises:
        Unusable: file or recording are damaged.
        MissingExtra: h5py is not installed.
    """
    load = _load_json if file.name.endswith(".json") else _load_hdf5
    arrays = {key: _checked(key, value) for key, value in load(data).items()}
    tip, disk = (_clean(key, arrays[key]) for key in (TIP, OBJECT))
    time = np.union1d(disk.time, tip.time)
    recording = Recording(
        time=time,
        pose=_spread(disk.value, disk.time, time)[:, None],
        pusher=_spread(tip.value[:, :2], tip.time, time),
        conditions=conditions,
        plan=plan,
        source=str(file),
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
        raise MissingExtra(
            'HDF5 files need the package h5py: pip install "sainet[hdf5]"; '
            "without it give the .json files of the same pushes."
        ) from None
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
    if found.ndim != 2 or found.shape[0] > _MOST_SAMPLES:  # noqa: PLR2004
        raise Unusable(f"{key} is not N x 4 numbers")
    if found.shape[1] != _COLUMNS or found.dtype.kind not in "fiu":
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
