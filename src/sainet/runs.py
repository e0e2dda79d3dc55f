"""Run folders: what was asked for, by what it was made, and writes that are atomic."""

import errno
import hashlib
import json
import math
import os
import platform
import subprocess
import uuid
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from importlib import metadata
from pathlib import Path
from typing import Any

from sainet.errors import BadInput, RunConflict
from sainet.locks import FolderLock, lock_folder

FORMAT_VERSION = 1
CONFIG = "config.json"
MANIFEST = "manifest.json"


def to_json(value: object) -> str:
    """Return JSON text: sorted keys, so that the same value is the same bytes."""
    return json.dumps(value, indent=2, sort_keys=True, allow_nan=False) + "\n"


def content_hash(data: bytes) -> str:
    """Return the SHA-256 of bytes, in hexadecimal."""
    return hashlib.sha256(data).hexdigest()


@contextmanager
def atomic_path(path: Path) -> Iterator[Path]:
    """Give a temporary path that takes the place of `path` if all went well.

    Whoever reads `path` sees the old file or the new one, never a part of it.

    Raises:
        BadInput: the disk is full or the folder cannot be written.
    """
    temporary = path.with_name(f".{path.name}.{uuid.uuid4().hex}.partial")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        yield temporary
        os.replace(temporary, path)
    except OSError as error:
        raise write_error(path, error) from error
    finally:
        with suppress(OSError):
            temporary.unlink(missing_ok=True)


def write_error(path: Path, error: OSError) -> BadInput:
    """Say what stopped a write, in one line."""
    if error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG):
        return BadInput(
            f"{path}: the disk is full; make room, then run the same command again."
        )
    return BadInput(f"{path}: cannot be written ({error.strerror}); choose another.")


def write_bytes(path: Path, data: bytes) -> None:
    """Write a file atomically."""
    with atomic_path(path) as temporary:
        temporary.write_bytes(data)


def write_json(path: Path, value: object) -> None:
    """Write a JSON file atomically."""
    write_bytes(path, to_json(value).encode())


@contextmanager
def readable(path: Path, error: type[BadInput] = BadInput) -> Iterator[None]:
    """Say in one line why a path that is looked at cannot be.

    Raises:
        BadInput: or the given subclass; the name is too long, say.
    """
    try:
        yield
    except OSError as cause:
        raise error(
            f"{path}: cannot be read ({cause.strerror}); choose another."
        ) from None


def read_json(path: Path, error: type[BadInput] = BadInput) -> dict[str, Any]:
    """Read a JSON object.

    Raises:
        BadInput: or the given subclass, when it is missing or no JSON object.
    """
    try:
        value = json.loads(path.read_text("utf-8"))
    except FileNotFoundError:
        raise error(f"{path}: no such file; was it made by sainet?") from None
    except (OSError, ValueError, RecursionError) as cause:
        reason = str(cause).splitlines()[0]
        raise error(f"{path}: cannot be read as JSON ({reason}).") from None
    if not isinstance(value, dict):
        raise error(f"{path}: must hold a JSON object, not a {type(value).__name__}.")
    return value


def is_number(value: object) -> bool:
    """Return whether a value that was read from JSON is a finite number."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    try:
        return math.isfinite(value)
    except OverflowError:  # an integer of hundreds of digits
        return False


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
        if not leftover.is_dir():  # of an import into this folder, maybe alive
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
            "choose another --out."
        ) from None
    except OSError as error:
        raise write_error(path, error) from error


def remake(path: Path) -> str:
    """Say how to make a damaged run again: a finished one is left alone."""
    return f"delete {path}, then run the command that made it again"


def _check_free(path: Path, wanted: dict[str, Any]) -> None:
    """Check that a folder is missing, empty, or of a run with these settings."""
    if path.exists() and not path.is_dir():
        raise RunConflict(f"{path}: is a file; give --out a folder.")
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
                f"{wanted.get(name)!r} here; choose another --out or the same settings."
            )


def manifest(devices: int = 0) -> dict[str, Any]:
    """Return by what a run was made: versions, commit and hardware, no dates."""
    names = ("sainet", "jax", "jaxlib", "equinox", "optax", "numpy", "scipy", "zarr")
    return {
        "format_version": FORMAT_VERSION,
        "versions": {name: _version(name) for name in (*names, "pybullet")},
        "git_commit": _git_commit(),
        "python": platform.python_version(),
        "machine": platform.machine(),
        "processor": processor(),
        "cores": os.cpu_count(),
        "devices": devices,
    }


def _version(name: str) -> str | None:
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return None


def _git_commit() -> str | None:
    """Return the commit of this checkout; None for an installed package."""
    here = Path(__file__).resolve().parent
    command = ["git", "-C", str(here), "ls-files", "--error-unmatch", "runs.py"]
    try:
        tracked = subprocess.run(command, capture_output=True, check=False, timeout=10)
        if tracked.returncode:
            return None
        command = ["git", "-C", str(here), "rev-parse", "HEAD"]
        done = subprocess.run(command, capture_output=True, check=False, timeout=10)
    except (OSError, subprocess.TimeoutExpired):
        return None
    return done.stdout.decode().strip() or None


def processor() -> str:
    """Return the name of this machine's processor."""
    with suppress(OSError):
        for line in Path("/proc/cpuinfo").read_text("utf-8").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor()
