"""Checks of a dataset: its files when it is opened, its values when they are read."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Literal

import msgspec
import numpy as np

from sainet.datasets.schema import (
    FORMAT_VERSION,
    Arrays,
    StoreInfo,
    Variable,
    chunk_shape,
    published_name,
    sizes,
    variables,
)
from sainet.datasets.writer import ARRAYS, HASHES, Hashes, chunk_file
from sainet.runs.documents import content_hash, read_document, read_file
from sainet.runs.errors import BadStore, shown
from sainet.runs.folders import remake
from sainet.scenes.quantities import Quantity

_METADATA = "zarr.json"
_LARGEST_METADATA = 1 << 20  # bytes
_LARGEST_CHUNK = 4 << 30  # bytes, decompressed
_OVERHEAD = 1 << 16  # bytes by which compression may enlarge a chunk
_ENDS = ("low", "high")  # of a range
_ZSTD = b"\x28\xb5\x2f\xfd"  # first bytes of a frame


class _Metadata(msgspec.Struct, forbid_unknown_fields=True):
    """A part of the metadata; Zarr refuses fields that it does not define."""


class _Group(_Metadata):
    attributes: StoreInfo
    zarr_format: Literal[3]
    node_type: Literal["group"]


class _ChunkShape(_Metadata):
    chunk_shape: tuple[int, ...]


class _ChunkGrid(_Metadata):
    name: Literal["regular"]
    configuration: _ChunkShape


class _Separator(_Metadata):
    separator: Literal["/"] = "/"


class _ChunkKeys(_Metadata):
    name: Literal["default"]
    configuration: _Separator = msgspec.field(default_factory=_Separator)


class _BytesSettings(_Metadata):
    endian: Literal["little"] = "little"


class _Bytes(_Metadata, tag="bytes", tag_field="name"):
    configuration: _BytesSettings = msgspec.field(default_factory=_BytesSettings)


class _ZstdSettings(_Metadata):
    level: int
    checksum: bool = False


class _Zstd(_Metadata, tag="zstd", tag_field="name"):
    configuration: _ZstdSettings


class _Array(_Metadata):
    """The metadata of an array, restricted to arrays that the writer makes."""

    shape: tuple[int, ...]
    data_type: Literal["float32", "int32", "uint8"]
    chunk_grid: _ChunkGrid
    chunk_key_encoding: _ChunkKeys
    fill_value: float | Literal["NaN"]
    codecs: Annotated[list[_Bytes | _Zstd], msgspec.Meta(min_length=2, max_length=2)]
    attributes: dict[str, str]
    zarr_format: Literal[3]
    node_type: Literal["array"]
    dimension_names: tuple[str, ...]
    storage_transformers: tuple[()] = ()


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
        raise _damaged(folder, HASHES, f"{shown(stray[0])} is no file of this dataset")
    for name, size in wanted.items():
        if name not in hashes:
            raise _damaged(folder, HASHES, f"{name} has no hash")
        _check_file(folder, name, hashes[name] if verify else None, size)
    for name, variable in known.items():
        _check_array(folder, name, info, variable)


def _damaged(folder: Path, name: str, reason: str) -> BadStore:
    return BadStore(f"{folder / name}: {reason}; {remake(folder)}.")


def _chunk_bytes(folder: Path, name: str, info: StoreInfo, variable: Variable) -> int:
    size = math.prod(chunk_shape(info, variable)) * np.dtype(variable.dtype).itemsize
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
    """Check that an array is stored exactly as the writer stores it."""
    path = folder / ARRAYS / name / _METADATA
    found = read_document(path, _Array, error=BadStore, remedy=remake(folder))
    shape = tuple(sizes(info)[d] for d in variable.dimensions)
    expected = {
        "shape": (found.shape, shape),
        "data_type": (found.data_type, np.dtype(variable.dtype).name),
        "chunk_shape": (
            found.chunk_grid.configuration.chunk_shape,
            chunk_shape(info, variable),
        ),
        "dimension_names": (found.dimension_names, variable.dimensions),
        "codecs": ([type(codec) for codec in found.codecs], [_Bytes, _Zstd]),
    }
    for field, (is_value, wanted) in expected.items():
        if is_value != wanted:
            reason = f"{field} is {shown(is_value)}, not {wanted}"
            raise _damaged(folder, f"{ARRAYS}/{name}", reason)


def check_values(
    folder: Path,
    info: StoreInfo,
    rows: np.ndarray,
    arrays: Arrays,
    read: Callable[[str], np.ndarray],
) -> None:
    """Check that all values of arrays are in their physical ranges.

    NaN stands for values that were not observed; nothing else may be NaN.

    Args:
        folder: of the dataset.
        info: of the dataset.
        rows: the numbers of the pushes.
        arrays: of these pushes.
        read: returns another array of these pushes.

    Raises:
        BadStore: a value is out of range; the message names array, push and value.
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
            reason = (
                f"push {rows[place[0]]}: {quantity.name} is {values[place]:g}; it must "
                f"be {quantity.wanted}"
            )
            raise _damaged(folder, f"{ARRAYS}/{name}", reason)


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
