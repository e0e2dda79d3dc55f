"""Writing of stores, chunk by chunk; a list of hashes, written last, completes them."""

import shutil
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from sainet.datasets.schema import (
    FORMAT_VERSION,
    Arrays,
    StoreInfo,
    Variable,
    chunk_shape,
    sizes,
    variables,
)
from sainet.runs.documents import (
    checked,
    content_hash,
    read_document,
    write_document,
    write_error,
)
from sainet.runs.errors import BadInput
from sainet.runs.folders import open_run

ARRAYS = "pushes.zarr"
HASHES = "hashes.json"
PROGRESS = "progress"
Hashes = dict[str, str]  # SHA-256 by file, relative to the folder of the arrays


class Listing(msgspec.Struct, frozen=True, kw_only=True):
    """Hashes of the files of a dataset; written last, so it marks a whole dataset."""

    files: Hashes
    format_version: int = FORMAT_VERSION


def create_arrays(folder: Path, info: StoreInfo) -> None:
    """Create the empty arrays of a store; repeated calls give the same bytes.

    Raises:
        BadInput: the disk is full, or a property of the dataset is out of range.
    """
    import zarr
    from zarr.codecs import ZstdCodec

    attributes = msgspec.to_builtins(checked(info, folder))
    try:
        group = zarr.open_group(folder / ARRAYS, mode="a", attributes=None)
        group.attrs.put(attributes)
        for name, variable in variables(info).items():
            if name in group:
                continue
            shape = tuple(sizes(info)[d] for d in variable.dimensions)
            group.create_array(
                name,
                shape=shape,
                chunks=chunk_shape(info, variable),
                dtype=variable.dtype,
                fill_value=np.nan if variable.dtype is np.float32 else 0,
                compressors=ZstdCodec(level=1),
                dimension_names=variable.dimensions,
                attributes={"units": variable.units, "long_name": variable.meaning},
                config={"write_empty_chunks": True},
            )
    except OSError as error:
        raise write_error(folder / ARRAYS, error) from error


def write_chunk(folder: Path, info: StoreInfo, index: int, arrays: dict) -> None:
    """Write one chunk of every array, then its receipt.

    Args:
        folder: run folder.
        info: of the store.
        index: index of the chunk.
        arrays: NumPy arrays by variable name, shape ``[pushes of the chunk, ...]``.

    Raises:
        BadInput: the disk is full.
    """
    import zarr

    try:
        group = zarr.open_group(folder / ARRAYS, mode="r+")
        with zarr.config.set({"array.write_empty_chunks": True}):
            for name, variable in variables(info).items():
                value = np.asarray(arrays[name], variable.dtype)
                group[name][info.chunk_slice(index)] = value  # pyright: ignore
    except OSError as error:
        raise write_error(folder / ARRAYS, error) from error
    hashes = {
        name: content_hash((folder / ARRAYS / name).read_bytes())
        for name in chunk_files(info, index)
    }
    write_document(_receipt(folder, index), Listing(files=hashes))


def chunk_files(info: StoreInfo, index: int) -> list[str]:
    """Return the files of one chunk, relative to the folder of the arrays."""
    return [chunk_file(name, each, index) for name, each in variables(info).items()]


def chunk_file(name: str, variable: Variable, index: int) -> str:
    """Return the file of one chunk of an array."""
    return "/".join([name, "c", str(index), *["0"] * (len(variable.dimensions) - 1)])


def missing_chunks(folder: Path, info: StoreInfo) -> list[int]:
    """Return the chunks that are not written yet.

    A chunk is complete if its receipt exists and its files match the receipt.
    Remains of an interrupted writer are removed.
    """
    for leftover in (folder / ARRAYS).rglob("*.partial"):
        leftover.unlink(missing_ok=True)
    return [i for i in range(info.chunks) if not _is_written(folder, info, i)]


def _is_written(folder: Path, info: StoreInfo, index: int) -> bool:
    try:
        receipt = read_document(_receipt(folder, index), Listing).files
    except BadInput:
        return False
    return all(
        name in receipt and _hash_or_none(folder / ARRAYS / name) == receipt[name]
        for name in chunk_files(info, index)
    )


def _hash_or_none(path: Path) -> str | None:
    return content_hash(path.read_bytes()) if path.is_file() else None


def _receipt(folder: Path, index: int) -> Path:
    return folder / PROGRESS / f"chunk-{index:06d}.json"


def finish(folder: Path, info: StoreInfo) -> None:
    """Write the list of all hashes, which completes the dataset."""
    hashes: Hashes = {}
    for index in range(info.chunks):
        hashes |= read_document(_receipt(folder, index), Listing).files
    for path in sorted((folder / ARRAYS).rglob("zarr.json")):
        name = path.relative_to(folder / ARRAYS).as_posix()
        hashes[name] = content_hash(path.read_bytes())
    write_document(folder / HASHES, Listing(files=hashes))
    clear_progress(folder)


def clear_progress(folder: Path) -> None:
    """Remove the receipts of a finished store, if there are any."""
    shutil.rmtree(folder / PROGRESS, ignore_errors=True)


def write_store(folder: Path, info: StoreInfo, arrays: dict) -> None:
    """Write a store whose arrays are in memory."""
    create_arrays(folder, info)
    for index in range(info.chunks):
        part = {k: v[info.chunk_slice(index)] for k, v in arrays.items()}
        write_chunk(folder, info, index, part)
    finish(folder, info)


def write_once(
    out: Path,
    settings: Mapping[str, Any],
    info: StoreInfo,
    make_chunk: Callable[[int], Arrays],
) -> None:
    """Write a store into a run folder; resume an interrupted one.

    Args:
        out: run folder.
        settings: JSON values that determine the store.
        info: of the store.
        make_chunk: returns the arrays of one chunk.

    Raises:
        RunConflict: the folder belongs to another run, or another process uses it.
        BadInput: the disk is full.
    """
    if open_run(out, settings, finished_by=HASHES).is_finished:
        clear_progress(out)
        return
    create_arrays(out, info)
    for index in missing_chunks(out, info):
        write_chunk(out, info, index, make_chunk(index))
    finish(out, info)
