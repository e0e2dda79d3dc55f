"""Files of the raw MIT Push dataset, written with every trap that real ones have.

The motion is analytic, so that tests know what has to come out.
"""

import io
import json
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np

from support import require

EPOCH = 1_450_000_000.0  # s
SPEED = 0.05  # m/s
TURNING = 0.4  # rad/s
RATE = 250  # Hz
START = (0.3, -0.05)  # m
YAW = 3.1  # rad: it passes pi soon
REACH = 0.05725  # m, from the pusher to the centre of the disk


def name(ending: str = "json", **changed) -> str:
    """The name of a file as the dataset spells it."""
    said = {"surface": "abs", "shape": "ellip1", "a": 0, "v": 50}
    said |= {"i": 0.0, "s": 0.25, "t": 0.0, "rep": None} | changed
    text = "motion_surface={surface}_shape={shape}_a={a:.0f}_v={v:.0f}".format(**said)
    text += "_i={i:.3f}_s={s:.3f}_t={t:.3f}".format(**said)
    repeat = "" if said["rep"] is None else f"_rep={said['rep']:04d}"
    return f"{text}{repeat}.{ending}"


def path_of(seconds: np.ndarray) -> np.ndarray:
    """Where the disk is: x, y and yaw, never wrapped."""
    x, y = START[0] + SPEED * seconds, START[1] + 0.2 * SPEED * seconds
    return np.column_stack([x, y, YAW + TURNING * seconds])


def tip_of(seconds: np.ndarray) -> np.ndarray:
    """Where the pusher is: x and y."""
    return path_of(seconds)[:, :2] - [REACH, 0.0]


def recording(duration: float = 1.0) -> dict[str, np.ndarray]:
    """A push whose tip begins 1.7 ms after the object, each on its own clock."""
    disk = np.arange(0, duration, 1 / RATE)
    tip = 0.0017 + np.arange(0, duration, 1 / RATE)
    wrench = 0.0004 + np.arange(0, duration, 1 / RATE)
    pose = path_of(disk)
    pose[:, 2] = (pose[:, 2] + np.pi) % (2 * np.pi) - np.pi
    turned = np.zeros((len(tip), 1))
    return {
        "object_pose": np.column_stack([EPOCH + disk, pose]),
        "tip_pose": np.column_stack([EPOCH + tip, tip_of(tip), turned]),
        "ft_wrench": np.column_stack([EPOCH + wrench, *np.zeros((3, len(wrench)))]),
    }


def with_traps() -> dict[str, np.ndarray]:
    """The same push with repeated stamps and yaw that jumps by 90 and 180 degrees."""
    arrays = recording()
    disk = arrays["object_pose"]
    disk[100:, 3] += np.pi / 2
    disk[180:, 3] -= np.pi
    arrays["object_pose"] = np.insert(disk, [40, 40, 200], disk[[39, 39, 199]], axis=0)
    tip = arrays["tip_pose"]
    arrays["tip_pose"] = np.insert(tip, [70], tip[[69]], axis=0)
    return arrays


def changed(change: Callable[[dict[str, np.ndarray]], object]) -> bytes:
    """A JSON file of a recording that something was done to."""
    arrays = recording()
    change(arrays)
    return to_json(arrays)


def to_json(arrays: dict[str, np.ndarray]) -> bytes:
    return json.dumps({key: value.tolist() for key, value in arrays.items()}).encode()


def to_hdf5(arrays: dict[str, np.ndarray]) -> bytes:
    """The same as HDF5."""
    require(has_hdf5(), "h5py is missing: pip install 'sainet[hdf5]'")
    import h5py

    buffer = io.BytesIO()
    with h5py.File(buffer, "w") as file:
        for key, value in arrays.items():
            file.create_dataset(key, data=value, compression="gzip")
    return buffer.getvalue()


def has_hdf5() -> bool:
    try:
        import h5py  # noqa: F401
    except ImportError:
        return False
    return True


def pack(path: Path, files: dict[str, bytes], compression=zipfile.ZIP_DEFLATED) -> Path:
    """Write a zip."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with zipfile.ZipFile(path, "w", compression) as archive:
        for member, data in files.items():
            archive.writestr(member, data)
    return path
