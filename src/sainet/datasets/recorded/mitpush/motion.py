"""One recorded push of the raw MIT Push dataset: read, and cleaned of its traps."""

import io
import json
from typing import Any

import numpy as np
from jaxtyping import Float

from sainet.datasets.recorded.push import RecordedPush, Unusable, resample
from sainet.datasets.recorded.tracks import (
    ALLOWED_MOVE,
    ALLOWED_TURN,
    Track,
    distances,
    first_fall,
    first_jump,
    without_repeats,
    without_symmetry_jumps,
)
from sainet.runs.errors import MissingExtra

OBJECT, TIP = "object_pose", "tip_pose"
_COLUMNS = 4  # t, x, y, yaw
_MOST_SAMPLES = 1_000_000
_LONGEST_GAP = 0.05  # s: in more, a real turn may look like another side of the marker
_FAR = 5.0  # m: beyond the reach of the robot's arm


def read_motion(name: str, data: bytes, group: str) -> RecordedPush:
    """Return the push that a file holds.

    Args:
        name: of the file; its ending says what the data are.
        data: what the file holds.
        group: that the push belongs to.

    Raises:
        Unusable: the file is damaged, or the recording in it is.
        MissingExtra: h5py is not installed.
    """
    load = _load_json if name.endswith(".json") else _load_hdf5
    arrays = {key: _checked(key, value) for key, value in load(data).items()}
    tip, disk = (_clean(key, arrays[key]) for key in (TIP, OBJECT))
    return resample(disk, Track(tip.time, tip.value[:, :2]), group)


def _load_json(data: bytes) -> dict[str, np.ndarray]:
    try:
        content = json.loads(data)
        return {key: np.asarray(content[key]) for key in (TIP, OBJECT)}
    except (ValueError, KeyError, TypeError, RecursionError, OverflowError):
        raise Unusable("damaged, or no recording of a push") from None


def _load_hdf5(data: bytes) -> dict[str, np.ndarray]:
    try:
        import h5py  # pyright: ignore[reportMissingImports]
    except ImportError:
        raise MissingExtra(
            'HDF5 files need the package h5py: pip install "sainet[hdf5]"; '
            "without it give the .json files of the same pushes."
        ) from None
    # Of a damaged file the HDF5 library raises whatever it stumbles over.
    try:
        with h5py.File(io.BytesIO(data), "r") as file:
            return {key: _dataset(h5py, file, key) for key in (TIP, OBJECT)}
    except Unusable:
        raise
    except Exception:
        raise Unusable("damaged, or no recording of a push") from None


def _dataset(h5py: Any, file: Any, key: str) -> np.ndarray:  # noqa: ANN401
    """Read an array that lies in the file itself, once its size is known."""
    link = file.get(key, getlink=True)
    if not isinstance(link, h5py.HardLink):
        raise Unusable(f"{key} is no array of the file")
    found = file[key]
    if not isinstance(found, h5py.Dataset) or found.is_virtual or found.external:
        raise Unusable(f"{key} is no array of the file")
    if found.ndim != 2 or found.shape[0] > _MOST_SAMPLES:  # noqa: PLR2004
        raise Unusable(f"{key} is not N x 4 numbers")
    if found.shape[1] != _COLUMNS or found.dtype.kind not in "fiu":
        raise Unusable(f"{key} is not N x 4 numbers")
    return found[()]


def _checked(key: str, value: np.ndarray) -> Float[np.ndarray, "sample 4"]:
    if value.dtype.kind not in "fiu" or value.shape[1:] != (_COLUMNS,):
        raise Unusable(f"{key} is not N x 4 numbers")
    if len(value) > _MOST_SAMPLES or not np.isfinite(value).all():
        raise Unusable(f"{key} holds NaN, infinity or too many samples")
    return value.astype(float)


def _clean(key: str, value: Float[np.ndarray, "sample 4"]) -> Track:
    """Return x, y and unwrapped yaw on a clock that rises."""
    track = without_repeats(Track(value[:, 0], value[:, 1:]))
    time, place = track.time, track.value[:, :2]
    if len(time) < 2:  # noqa: PLR2004
        raise Unusable(f"{key} has fewer than two samples")
    if first_fall(time) is not None:
        raise Unusable(f"{key}: the clock runs backwards")
    if np.diff(time).max() > _LONGEST_GAP:
        raise Unusable(f"{key} has a gap of more than 50 ms")
    if np.abs(place).max() > _FAR:
        raise Unusable(f"{key} is out of the robot's reach")
    if first_jump(time, distances(place), ALLOWED_MOVE) is not None:
        raise Unusable(f"{key} jumps")
    yaw = without_symmetry_jumps(track.value[:, 2])
    # The pusher is round: what it turns by does not matter.
    turned = np.abs(np.diff(yaw))
    if key == OBJECT and first_jump(time, turned, ALLOWED_TURN) is not None:
        raise Unusable(f"{key}: the yaw jumps")
    return Track(time, np.column_stack([place, yaw]))
