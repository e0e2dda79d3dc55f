"""Checks of a dataset: its files when it is opened, its values when they are read."""

import math
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Literal

import msgspec
import numpy as np

from sainet.datasets.schema import (
    ARRAYS,
    FORMAT_VERSION,
    HASHES,
    Arrays,
    Hashes,
    StoreInfo,
    Variable,
    chunk_file,
    published_name,
    variables,
)
from sainet.runs.documents import content_hash, read_document, read_file, read_json
from sainet.runs.errors import BadStore, shown
from sainet.runs.folders import remake
from sainet.scenes.quantities import Quantity

_METADATA = "zarr.json"
_LARGEST_METADATA = 1 << 20  # bytes
_LARGEST_CHUNK = 4 << 30  # bytes, decompressed
_OVERHEAD = 1 << 16  # bytes by which compression may enlarge a chunk
_ENDS = ("low", "high")  # of a range
# Fields that Zarr may leave out where they have the wanted value.
_OPTIONAL = {"separator", "endian", "checksum", "storage_transformers"}
_ZSTD = b"\x28\xb5\x2f\xfd"  # first bytes of a frame


class _Group(msgspec.Struct, forbid_unknown_fields=True):
    """The metadata of the group of all arrays."""

    attributes: StoreInfo
    zarr_format: Literal[3]
    node_type: Literal["group"]


def read_info(folder: Path) -> StoreInfo:
    """Return the properties of a dataset, read from its attributes.

    Raises:
        BadStore: an attribute is missing or out of range.
    """
    path, remedy = folder / ARRAYS / _METADATA, remake(folder)
    info = read_document(path, _Group, error=BadStore, remedy=remedy).attributes
    if info.format_version != FORMAT_VERSION:
        raise BadStore(
            f"{path}: attributes.format_version is {info.format_version}; {remedy}."
        )
    return info


def check_files(folder: Path, info: StoreInfo, hashes: Hashes, *, verify: bool) -> None:
    """Check that the files of a dataset are complete, unchanged and of the right shape.

    Args:
        folder: of the dataset.
        info: of the dataset.
        hashes: of its files.
        verify: compare every file with its hash.

    Raises:
        BadStore: a file is missing, changed, or not an array that the writer makes.
    """
    known = variables(info)
    # The most bytes of each file; of a chunk None stands for its decompressed size.
    wanted: dict[str, int | None] = {_METADATA: None}
    for name, variable in known.items():
        wanted[f"{name}/{_METADATA}"] = None
        size = _chunk_bytes(folder, name, info, variable)
        for index in range(info.chunks):
            wanted[chunk_file(name, variable, index)] = size
    if stray := sorted(hashes.keys() - wanted.keys()):
        raise _damaged(
            folder, HASHES, f"{shown(stray[0])} is not a file of this dataset"
        )
    for name, size in wanted.items():
        if name not in hashes:
            raise _damaged(folder, HASHES, f"{name} has no hash")
        _check_file(folder, name, hashes[name] if verify else None, size)
    for name, variable in known.items():
        _check_array(folder, name, info, variable)


def _damaged(folder: Path, name: str, reason: str) -> BadStore:
    return BadStore(f"{folder / name}: {reason}; {remake(folder)}.")


def _chunk_bytes(folder: Path, name: str, info: StoreInfo, variable: Variable) -> int:
    size = math.prod(variable.chunk_shape(info)) * np.dtype(variable.dtype).itemsize
    if size > _LARGEST_CHUNK:
        reason = f"its chunks have {size} bytes, more than {_LARGEST_CHUNK}"
        raise _damaged(folder, f"{ARRAYS}/{name}", reason)
    return size


def _check_file(folder: Path, name: str, known: str | None, size: int | None) -> None:
    """Check one file against its hash, and a chunk's size without decompressing it."""
    path = folder / ARRAYS / name
    if not path.exists():
        raise _damaged(folder, f"{ARRAYS}/{name}", "missing")
    if known is None:
        return
    most = _LARGEST_METADATA if size is None else size + size // 64 + _OVERHEAD
    data = read_file(path, most=most, error=BadStore)
    if content_hash(data) != known:
        reason = "truncated or changed since it was written"
        raise _damaged(folder, f"{ARRAYS}/{name}", reason)
    if size is not None and (found := _decompressed_bytes(data)) != size:
        reason = f"holds {'no' if found is None else found} bytes, not {size}"
        raise _damaged(folder, f"{ARRAYS}/{name}", reason)


def _decompressed_bytes(data: bytes) -> int | None:
    """Return the content size that a Zstandard frame declares (RFC 8878, 3.1.1.1)."""
    if data[: len(_ZSTD)] != _ZSTD or len(data) <= len(_ZSTD):
        return None
    descriptor = data[len(_ZSTD)]
    is_single = descriptor >> 5 & 1
    start = len(_ZSTD) + 1 + (not is_single) + (0, 1, 2, 4)[descriptor & 3]
    length = (is_single, 2, 4, 8)[descriptor >> 6]
    if not length or len(data) < start + length:
        return None
    size = int.from_bytes(data[start : start + length], "little")
    return size + 256 if length == 2 else size  # noqa: PLR2004


def _check_array(folder: Path, name: str, info: StoreInfo, variable: Variable) -> None:
    """Check that the metadata of an array are those that the writer writes."""
    found = read_json(folder / ARRAYS / name / _METADATA, BadStore)
    reason = _difference(found, _array_metadata(info, variable))
    if reason:
        raise _damaged(folder, f"{ARRAYS}/{name}", reason)


def _array_metadata(info: StoreInfo, variable: Variable) -> dict[str, object]:
    """Return the metadata of an array: tuples for lists, types for any such value."""
    chunks = {"chunk_shape": variable.chunk_shape(info)}
    zstd = {"level": int, "checksum": False}
    return {
        "shape": variable.shape(info),
        "data_type": np.dtype(variable.dtype).name,
        "chunk_grid": {"name": "regular", "configuration": chunks},
        "chunk_key_encoding": {"name": "default", "configuration": {"separator": "/"}},
        "fill_value": "NaN" if variable.dtype is np.float32 else 0,
        "codecs": (
            {"name": "bytes", "configuration": {"endian": "little"}},
            {"name": "zstd", "configuration": zstd},
        ),
        "attributes": {"units": variable.units, "long_name": str},
        "zarr_format": 3,
        "node_type": "array",
        "dimension_names": variable.dimensions,
        "storage_transformers": (),
    }


def _is_needed(name: str, wanted: object) -> bool:
    """Whether Zarr writes a field always: not if all that is in it may be left out."""
    if isinstance(wanted, dict):
        return any(_is_needed(inner, part) for inner, part in wanted.items())
    return name not in _OPTIONAL


def _difference(found: object, wanted: object, field: str = "") -> str:
    """Return how a part of a JSON document differs from the wanted part, if it does."""
    if isinstance(wanted, dict) and isinstance(found, dict):
        if unknown := sorted(found.keys() - wanted.keys()):
            return f"{field}{shown(unknown[0])} is unknown"
        needed = {name for name, part in wanted.items() if _is_needed(name, part)}
        if missing := sorted(needed - found.keys()):
            return f"{field}{missing[0]} is missing"
        parts = ((found[name], wanted[name], f"{field}{name}.") for name in found)
    elif isinstance(wanted, tuple) and isinstance(found, list):
        if len(found) != len(wanted):
            return f"{field}length is {len(found)}, not {len(wanted)}"
        places = range(len(found))
        parts = ((found[i], wanted[i], f"{field}{i}.") for i in places)
    elif type(found) is (wanted if isinstance(wanted, type) else type(wanted)) and (
        isinstance(wanted, type) or found == wanted
    ):
        return ""
    else:
        return f"{field.rstrip('.')} is {shown(found)}, not {wanted}"
    return next(filter(None, (_difference(*part) for part in parts)), "")


def check_values(
    folder: Path,
    info: StoreInfo,
    rows: np.ndarray,
    arrays: Arrays,
    read: Callable[[str], np.ndarray],
) -> None:
    """Check that all values of arrays are in their physical ranges.

    Args:
        folder: of the dataset.
        info: of the dataset.
        rows: the numbers of the pushes.
        arrays: of these pushes.
        read: returns another array of these pushes.

    Raises:
        BadStore: a value is out of range; the message names array, push and value.
    """
    for name, reason in out_of_range(info, rows, arrays, read):
        raise _damaged(folder, f"{ARRAYS}/{name}", reason)


def out_of_range(
    info: StoreInfo, rows: np.ndarray, arrays: Arrays, read: Callable[[str], np.ndarray]
) -> Iterator[tuple[str, str]]:
    """Yield arrays with a value out of range: name, and push and value as a reason.

    NaN stands for values that were not observed; nothing else may be NaN.

    Args:
        info: of the dataset.
        rows: the numbers of the pushes.
        arrays: of these pushes.
        read: returns another array of these pushes.
    """
    known = variables(info)
    published = {published_name(model) for model in info.published}
    for name, values in arrays.items():
        quantities = _quantities(name, known[name], info)
        if not quantities or not values.size or _are_within(values, quantities):
            continue
        low, high = (np.array([getattr(q, end) for q in quantities]) for end in _ENDS)
        bad = ~((values >= low) & (values <= high))
        known_only = name not in published
        bad &= ~np.isnan(values) | (known_only & _must_be_known(name, values, read))
        if bad.any():
            place = tuple(np.argwhere(bad)[0])
            quantity = quantities[place[-1] if len(quantities) > 1 else 0]
            yield (
                name,
                f"push {rows[place[0]]}: {quantity.name} is {values[place]:g}; it must "
                f"be {quantity.wanted}",
            )


def _quantities(name: str, variable: Variable, info: StoreInfo) -> tuple[Quantity, ...]:
    if name == "steps":
        return (Quantity("steps", "", 1, info.steps),)
    if name == "group":
        return (Quantity("group", "", 0, max(len(info.groups) - 1, 0)),)
    if variable.dtype is np.uint8:
        return (Quantity("flag", "", 0, 1),)
    return variable.quantities


def _are_within(values: np.ndarray, quantities: tuple[Quantity, ...]) -> bool:
    """Return whether all values are in the narrowest range: true of nearly all data."""
    low = max(quantity.low for quantity in quantities)
    high = min(quantity.high for quantity in quantities)
    return bool(values.min() >= low and values.max() <= high)  # False for NaN


def _must_be_known(
    name: str, values: np.ndarray, read: Callable[[str], np.ndarray]
) -> np.ndarray:
    """Return where values must be finite, in a shape that broadcasts to theirs."""
    if name not in ("truth", "measured"):
        return np.ones(1, bool)
    exists = np.arange(values.shape[1]) < read("steps")[:, None]
    pose, rate = (read(f"{each}_observed") > 0 for each in ("pose", "rate"))
    flags = np.stack([pose] * 3 + [rate] * (values.shape[-1] - 3), axis=-1)
    return (flags & exists[..., None])[:, :, None]
