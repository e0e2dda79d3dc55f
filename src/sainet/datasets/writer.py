"""Writing of stores, chunk by chunk; a list of hashes, written last, completes them."""

import logging
import shutil
from collections.abc import Callable, Mapping
from concurrent.futures import Executor
from contextlib import suppress
from pathlib import Path

import msgspec
import numpy as np

from sainet.datasets import schema
from sainet.datasets.store import Store, open_store
from sainet.runs import documents
from sainet.runs.errors import BadInput
from sainet.runs.folders import open_run
from sainet.runs.shards import Collected, Shard, collect, open_share
from sainet.runs.workers import each_done

PROGRESS = "progress"
_log = logging.getLogger(__name__)
MakeChunk = Callable[[int], schema.Arrays]  # of an index


def write_once(
    out: Path,
    settings: Mapping[str, object],
    info: schema.StoreInfo,
    make_chunk: MakeChunk,
    *,
    executor: Executor | None = None,
    on_pushes: Callable[[int], None] = lambda pushes: None,
) -> Store:
    """Return the store in a run folder; write it first, or resume writing.

    Args:
        out: run folder.
        settings: JSON values that determine the store.
        info: of the store.
        make_chunk: returns the arrays of one chunk.
        executor: makes and writes the chunks; None does so in this process.
        on_pushes: called with the number of newly written pushes.

    Raises:
        RunConflict: the folder belongs to another run, or another process uses it.
        BadInput: the disk is full.
    """
    # Locked as long as it exists.
    folder = open_run(out, settings, finished_by=schema.HASHES)
    if folder.is_finished:
        _log.info("%s is finished already", out)
        _clear_progress(out)
    else:
        shards = collect(out, settings)
        _write(out, info, make_chunk, executor, on_pushes=on_pushes, shards=shards)
    return open_store(out)


def write_share(
    out: Path,
    settings: Mapping[str, object],
    info: schema.StoreInfo,
    make_chunk: MakeChunk,
    *,
    shard: Shard,
    executor: Executor | None = None,
    on_pushes: Callable[[int], None] = lambda pushes: None,
) -> int:
    """Write the chunks of a shard, and return the number of their pushes.

    `write_once` with equal arguments finishes the store.

    Raises:
        RunConflict: the folder belongs to another run, or to shards of other versions.
        BadInput: the disk is full.
    """
    folder = open_run(out, settings, finished_by=schema.HASHES, shared=True)
    own = shard.own(info.chunks)
    pushes = sum(map(info.chunk_length, own))
    if folder.is_finished:
        on_pushes(pushes)
        return pushes
    with open_share(out, settings, shard):  # its lists: the receipts of the chunks
        _create_arrays(out, info)
        missing = [index for index in own if not _is_written(out, info, index)]
        on_pushes(pushes - sum(map(info.chunk_length, missing)))
        jobs = [(out, info, index, make_chunk) for index in missing]
        for index in each_done(executor, write_chunk, jobs):
            on_pushes(info.chunk_length(index))
    return pushes


def derive(
    store: Store,
    out: Path,
    settings: Mapping[str, object],
    change: Callable[[schema.Arrays], schema.Arrays],
) -> Store:
    """Return a dataset that a function makes of another dataset; written once.

    Args:
        store: read whole into memory.
        out: the run folder.
        settings: settings of the function, as JSON values: with the content of the
            store, they identify the derived dataset.
        change: returns the changed arrays, with fewer pushes or more disks.

    Raises:
        RunConflict: the folder belongs to another run.
    """
    known = {"command": "derive", "data": store.content, **settings}
    folder = open_run(out, known, finished_by=schema.HASHES)
    if not folder.is_finished:
        arrays = change(store.read(slice(None)))
        pushes, bodies = arrays["mass"].shape
        info = msgspec.structs.replace(store.info, pushes=pushes, bodies=bodies)
        write_store(out, info, arrays, known)
    return open_store(out)


def write_store(
    out: Path,
    info: schema.StoreInfo,
    arrays: schema.Arrays,
    settings: Mapping[str, object] | None = None,
) -> None:
    """Write a store whose arrays are in memory, in a run folder.

    Args:
        out: the run folder.
        info: of the store.
        arrays: of all pushes.
        settings: JSON values that determine the store; None: nothing else does.

    Raises:
        RunConflict: the folder belongs to another run.
        BadInput: the disk is full, or a property of the dataset is out of range.
    """

    def part(index: int) -> schema.Arrays:
        return {name: a[info.chunk_slice(index)] for name, a in arrays.items()}

    run = open_run(out, settings or {}, finished_by=schema.HASHES)
    _write(run.path, info, part, None)


def _write(
    folder: Path,
    info: schema.StoreInfo,
    make_chunk: MakeChunk,
    executor: Executor | None,
    *,
    on_pushes: Callable[[int], None] = lambda pushes: None,
    shards: Collected | None = None,
) -> None:
    """Write the missing chunks, then the list of all hashes, which completes it."""
    _create_arrays(folder, info)
    missing = missing_chunks(folder, info)
    if shards is not None:
        shards.tell(len(missing), info.chunks)
    on_pushes(info.pushes - sum(map(info.chunk_length, missing)))
    jobs = [(folder, info, index, make_chunk) for index in missing]
    for index in each_done(executor, write_chunk, jobs):
        on_pushes(info.chunk_length(index))
    hashes: schema.Hashes = {}
    for index in range(info.chunks):
        hashes |= documents.read_document(_receipt(folder, index), schema.Listing).files
    for path in sorted((folder / schema.ARRAYS).rglob("zarr.json")):
        name = path.relative_to(folder / schema.ARRAYS).as_posix()
        hashes[name] = documents.content_hash(path.read_bytes())
    if shards is not None:  # before the last file: an interruption here loses nothing
        shards.clear()
    documents.write_document(folder / schema.HASHES, schema.Listing(files=hashes))
    _clear_progress(folder)


def _create_arrays(folder: Path, info: schema.StoreInfo) -> None:
    """Create the empty arrays of a store; repeated calls give the same bytes."""
    import zarr
    from zarr.codecs import ZstdCodec
    from zarr.errors import ContainsArrayError, ContainsGroupError

    attributes = msgspec.to_builtins(documents.checked(info, folder))
    try:
        try:
            group = zarr.open_group(folder / schema.ARRAYS, mode="a", attributes=None)
        except ContainsGroupError:  # another shard was faster
            group = zarr.open_group(folder / schema.ARRAYS, mode="r+")
        group.attrs.put(attributes)
        for name, variable in schema.variables(info).items():
            if name in group:
                continue
            with suppress(ContainsArrayError):  # another shard was faster
                group.create_array(
                    name,
                    shape=variable.shape(info),
                    chunks=variable.chunk_shape(info),
                    dtype=variable.dtype,
                    fill_value=np.nan if variable.dtype is np.float32 else 0,
                    compressors=ZstdCodec(level=1),
                    dimension_names=variable.dimensions,
                    attributes={"units": variable.units, "long_name": variable.meaning},
                    config={"write_empty_chunks": True},
                )
    except OSError as error:
        raise documents.write_error(folder / schema.ARRAYS, error) from error


def write_chunk(
    folder: Path, info: schema.StoreInfo, index: int, make_chunk: MakeChunk
) -> int:
    """Make and write one chunk of every array, then its receipt; return its index."""
    import zarr

    arrays = make_chunk(index)
    try:
        group = zarr.open_group(folder / schema.ARRAYS, mode="r+")
        with zarr.config.set({"array.write_empty_chunks": True}):
            for name, variable in schema.variables(info).items():
                value = np.asarray(arrays[name], variable.dtype)
                group[name][info.chunk_slice(index)] = value  # pyright: ignore
    except OSError as error:
        raise documents.write_error(folder / schema.ARRAYS, error) from error
    hashes = {
        name: documents.content_hash((folder / schema.ARRAYS / name).read_bytes())
        for name in chunk_files(info, index)
    }
    documents.write_document(_receipt(folder, index), schema.Listing(files=hashes))
    return index


def chunk_files(info: schema.StoreInfo, index: int) -> list[str]:
    """Return the files of one chunk, relative to the folder of the arrays."""
    return [
        schema.chunk_file(name, each, index)
        for name, each in schema.variables(info).items()
    ]


def missing_chunks(folder: Path, info: schema.StoreInfo) -> list[int]:
    """Return the chunks that are not written yet.

    A chunk is complete if its receipt and all its files exist. Remains of an
    interrupted writer are removed.

    Raises:
        BadInput: a file was changed after the receipt was written.
    """
    for leftover in (folder / schema.ARRAYS).rglob("*.partial"):
        leftover.unlink(missing_ok=True)
    return [i for i in range(info.chunks) if not _is_written(folder, info, i)]


def _is_written(folder: Path, info: schema.StoreInfo, index: int) -> bool:
    try:
        receipt = documents.read_document(_receipt(folder, index), schema.Listing).files
    except BadInput:
        return False
    paths = {name: folder / schema.ARRAYS / name for name in chunk_files(info, index)}
    is_complete = all(path.is_file() for path in paths.values())
    for name, path in paths.items() if is_complete else ():
        found = documents.content_hash(path.read_bytes())
        documents.check_seal(path, found, receipt.get(name, ""))
    return is_complete


def _receipt(folder: Path, index: int) -> Path:
    return folder / PROGRESS / f"chunk-{index:06d}.json"


def _clear_progress(folder: Path) -> None:
    """Remove the receipts of a finished store, if there are any."""
    shutil.rmtree(folder / PROGRESS, ignore_errors=True)
