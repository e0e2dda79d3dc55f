"""Run folders: settings, manifest and outputs of one command, resumable."""

import json
import os
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any
from weakref import WeakValueDictionary, finalize

import msgspec

from sainet.runs import documents
from sainet.runs.errors import RunConflict, shown
from sainet.runs.manifest import MANIFEST, Manifest, manifest

try:
    import fcntl
except ImportError:  # without POSIX, folders are not locked
    fcntl = None


class FolderLock:
    """Lock on a folder, exclusive or shared by shards.

    It is released with its last reference and with the process, even by `kill -9`.
    """

    def __init__(self, descriptor: int) -> None:
        """Take over the lock of a file descriptor."""
        finalize(self, os.close, descriptor)


_held: WeakValueDictionary[tuple[str, bool], FolderLock] = WeakValueDictionary()


def lock_folder(folder: Path, *, shared: bool = False) -> FolderLock | None:
    """Return the lock of a folder, or None if the system has no locks.

    A lock that this process already holds is returned again, for example after an
    exception whose traceback keeps it.

    Args:
        folder: the folder.
        shared: whether other processes may hold a shared lock of it meanwhile.

    Raises:
        BlockingIOError: another process holds the lock.
    """
    place = os.path.realpath(folder)
    if (known := _held.get((place, shared))) is not None:
        return known
    if fcntl is None:
        return None
    descriptor = os.open(place, os.O_RDONLY)
    try:
        kind = fcntl.LOCK_SH if shared else fcntl.LOCK_EX
        fcntl.flock(descriptor, kind | fcntl.LOCK_NB)
    except OSError as error:
        os.close(descriptor)
        if isinstance(error, BlockingIOError):
            raise
        return None  # the file system has no locks
    lock = _held[place, shared] = FolderLock(descriptor)
    return lock


CONFIG = "config.json"


@dataclass(frozen=True)
class RunFolder:
    """The folder of one run; `finished_by` names the file that is written last."""

    path: Path
    finished_by: str
    # Held as long as this object exists.
    lock: FolderLock | None = field(default=None, compare=False, repr=False)

    @property
    def is_finished(self) -> bool:
        """Whether a run with the same settings has finished."""
        return (self.path / self.finished_by).is_file()


def open_run(
    path: Path,
    config: Mapping[str, Any],
    *,
    finished_by: str,
    devices: int = 0,
    shared: bool = False,
) -> RunFolder:
    """Return a new run folder, or the existing one with the same settings.

    Args:
        path: the folder; created if missing.
        config: the settings that determine the output, as JSON values.
        finished_by: the file, relative to the folder, that the run writes last.
        devices: number of JAX devices, if the output depends on it.
        shared: whether other processes may work in the folder, each at its own part.

    Raises:
        RunConflict: the folder belongs to another run, or another process uses it;
            nothing was changed.
    """
    wanted = json.loads(documents.to_json(dict(config)))
    folder = RunFolder(path, finished_by)
    with documents.readable(path, RunConflict):
        _check_free(path, wanted)
    try:
        folder = replace(folder, lock=_lock(path, shared))
    except RunConflict:
        if folder.is_finished:  # nothing remains to be written
            return folder
        raise
    # Another shard may be writing what looks like a leftover.
    for leftover in () if shared else path.glob(".*.partial"):
        if not leftover.is_dir():
            leftover.unlink(missing_ok=True)
    if not (path / MANIFEST).exists():
        made = msgspec.to_builtins(manifest(devices))
        documents.write_first(path / MANIFEST, made)
    if not (path / CONFIG).exists():
        documents.write_first(path / CONFIG, wanted)
    _check_free(path, wanted)  # a shard of other settings may have been first
    return folder


def _lock(path: Path, shared: bool) -> FolderLock | None:
    """Return the lock of the folder, which is created if missing."""
    try:
        path.mkdir(parents=True, exist_ok=True)
        return lock_folder(path, shared=shared)
    except BlockingIOError:
        raise RunConflict(
            f"{path}: another sainet process is using this folder; wait for it, or "
            "choose another `out`."
        ) from None
    except OSError as error:
        raise documents.write_error(path, error) from error


def remake(path: Path) -> str:
    """Return how to repeat a damaged run: finished runs stay unchanged otherwise."""
    return f"delete {path}, then run the command that made it again"


def _check_free(path: Path, wanted: dict[str, Any]) -> None:
    """Raise `RunConflict` unless a folder is free or has the same settings."""
    if path.exists() and not path.is_dir():
        raise RunConflict(f"{path}: is a file; choose a folder as `out`.")
    # Listed before the settings are looked for: another shard may be writing them.
    entries = list(path.iterdir()) if path.is_dir() else []
    if (path / MANIFEST).exists():
        documents.read_document(
            path / MANIFEST, Manifest, error=RunConflict, remedy=remake(path)
        )
    if (path / CONFIG).exists():
        _check_same(path, documents.read_json(path / CONFIG, RunConflict), wanted)
    elif not all(map(_may_be_left, entries)):
        raise RunConflict(f"{path}: not a sainet run folder; choose an empty folder.")


def _may_be_left(entry: Path) -> bool:
    """Return whether a file may remain from a run killed at its start."""
    return entry.name == MANIFEST or entry.name.endswith(".partial")


def _check_same(path: Path, found: dict[str, Any], wanted: dict[str, Any]) -> None:
    for name in sorted(found.keys() | wanted.keys()):
        if found.get(name) != wanted.get(name):
            raise RunConflict(
                f"{path / CONFIG}: {shown(name)} is {shown(found.get(name))}, not "
                f"{shown(wanted.get(name))}; choose another `out` or the same settings."
            )


class Keyed(msgspec.Struct, frozen=True):
    """A structure whose representation names run folders of studies.

    It leaves out fields that are unset: names stay when a structure gets a field.
    """

    def __repr__(self) -> str:
        """Return the fields, without those that are unset."""
        fields = {name: getattr(self, name) for name in self.__struct_fields__}
        shown = [f"{k}={v!r}" for k, v in fields.items() if v is not msgspec.UNSET]
        return f"{type(self).__name__}({', '.join(shown)})"
