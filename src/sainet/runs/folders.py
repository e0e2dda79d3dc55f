"""Run folders: one command's settings, manifest and outputs, resumable."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from sainet.runs.documents import (
    read_json,
    readable,
    to_json,
    write_error,
    write_json,
)
from sainet.runs.errors import RunConflict
from sainet.runs.locks import FolderLock, lock_folder
from sainet.runs.manifest import MANIFEST, manifest

CONFIG = "config.json"


@dataclass(frozen=True)
class RunFolder:
    """The folder of one run; `finished_by` names the file that is written last."""

    path: Path
    finished_by: str
    # Held as long as whoever works there keeps this.
    lock: FolderLock | None = field(default=None, compare=False, repr=False)

    @property
    def is_finished(self) -> bool:
        """Whether an earlier run with the same settings went to its end."""
        return (self.path / self.finished_by).is_file()


def open_run(
    path: Path, config: Mapping[str, Any], *, finished_by: str, devices: int = 0
) -> RunFolder:
    """Make a run folder or come back to one with the same settings.

    Args:
        path: the folder; made when missing.
        config: the settings that decide what the run makes, as JSON values.
        finished_by: the file, relative to the folder, that the run writes last.
        devices: of JAX, when the result depends on their number.

    Raises:
        RunConflict: the folder holds something else, or another process works there;
            nothing was touched.
    """
    wanted = json.loads(to_json(dict(config)))
    folder = RunFolder(path, finished_by)
    with readable(path, RunConflict):
        _check_free(path, wanted)
    try:
        folder = replace(folder, lock=_lock(path))
    except RunConflict:
        if folder.is_finished:  # there is nothing to write any more
            return folder
        raise
    for leftover in path.glob(".*.partial"):
        if not leftover.is_dir():
            leftover.unlink(missing_ok=True)
    if not (path / MANIFEST).exists():
        write_json(path / MANIFEST, manifest(devices))
    if not (path / CONFIG).exists():
        write_json(path / CONFIG, wanted)
    return folder


def _lock(path: Path) -> FolderLock | None:
    """Make the folder, if need be, and keep other processes from working there."""
    try:
        path.mkdir(parents=True, exist_ok=True)
        return lock_folder(path)
    except BlockingIOError:
        raise RunConflict(
            f"{path}: another sainet is at work there; wait until it has ended, or "
            "choose another `out`."
        ) from None
    except OSError as error:
        raise write_error(path, error) from error


def remake(path: Path) -> str:
    """Say how to make a damaged run again: a finished one is left alone."""
    return f"delete {path}, then run the command that made it again"


def _check_free(path: Path, wanted: dict[str, Any]) -> None:
    """Check that a folder is missing, empty, or of a run with these settings."""
    if path.exists() and not path.is_dir():
        raise RunConflict(f"{path}: is a file; give `out` a folder.")
    if (path / CONFIG).exists():
        _check_same(path, read_json(path / CONFIG, RunConflict), wanted)
    elif path.is_dir() and not all(map(_may_be_left, path.iterdir())):
        raise RunConflict(f"{path}: is not empty and no run of sainet; choose another.")


def _may_be_left(entry: Path) -> bool:
    """Whether this is what a run that was killed as it began leaves behind."""
    return entry.name == MANIFEST or entry.name.endswith(".partial")


def _check_same(path: Path, found: dict[str, Any], wanted: dict[str, Any]) -> None:
    for name in sorted(found.keys() | wanted.keys()):
        if found.get(name) != wanted.get(name):
            raise RunConflict(
                f"{path / CONFIG}: {name} is {found.get(name)!r} there and "
                f"{wanted.get(name)!r} here; choose another `out` or the same settings."
            )


