"""Documents on disk: JSON, hashes and atomic writes."""

import errno
import hashlib
import json
import math
import os
import stat
import uuid
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, TypeVar

import msgspec

from sainet.runs.errors import BadInput


FORMAT_VERSION = 1
LARGEST_DOCUMENT = 64 << 20  # bytes
_LONGEST_REASON = 200  # characters of a message that quote a file
T = TypeVar("T")


def to_json(value: object) -> str:
    """Return JSON text with sorted keys, so that equal values give equal bytes."""
    return json.dumps(value, indent=2, sort_keys=True, allow_nan=False) + "\n"


def content_hash(data: bytes) -> str:
    """Return the SHA-256 of bytes, in hexadecimal."""
    return hashlib.sha256(data).hexdigest()


@contextmanager
def atomic_path(path: Path) -> Iterator[Path]:
    """Yield a temporary path that replaces `path` on success.

    Readers of `path` get the old file or the new file, never a part.

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
    """Return the error for a failed write, in one line."""
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
    """Raise an error in one line if a path cannot be inspected.

    Raises:
        BadInput: or the given subclass, for example for a name that is too long.
    """
    try:
        yield
    except OSError as cause:
        raise error(
            f"{path}: cannot be read ({cause.strerror}); choose another."
        ) from None


def read_json(path: Path, error: type[BadInput] = BadInput) -> dict[str, Any]:
    """Return the JSON object in a file.

    Raises:
        BadInput: or the given subclass, if the file is missing or not a JSON object.
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
    """Return whether a value from JSON is a finite number."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    try:
        return math.isfinite(value)
    except OverflowError:  # an integer of hundreds of digits
        return False


def read_file(
    path: Path, *, most: int = LARGEST_DOCUMENT, error: type[BadInput] = BadInput
) -> bytes:
    """Return the bytes of a regular file; devices, pipes and large files are refused.

    Args:
        path: of the file.
        most: bytes that it may have.
        error: to raise.

    Raises:
        BadInput: or the given subclass, when the file is missing, unreadable, too large
            or no regular file.
    """
    try:
        # Not blocking: to open a pipe would wait for a writer.
        descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK)
        with open(descriptor, "rb") as file:
            found = os.fstat(descriptor)
            if not stat.S_ISREG(found.st_mode):
                raise error(f"{path}: not a regular file; give a file.")
            if found.st_size > most:
                raise error(
                    f"{path}: {found.st_size} bytes; at most {most} are read."
                )
            return file.read(most)
    except FileNotFoundError:
        raise error(f"{path}: no such file.") from None
    except (OSError, ValueError) as cause:
        reason = getattr(cause, "strerror", None) or cause
        raise error(f"{path}: cannot be read ({reason}).") from None


def read_document(
    path: Path, kind: type[T], *, error: type[BadInput] = BadInput, remedy: str = ""
) -> T:
    """Return a JSON document as a msgspec struct, with every field checked.

    Args:
        path: of the file.
        kind: the struct.
        error: to raise.
        remedy: what the user can do, without a full stop: "train it again".

    Raises:
        BadInput: or the given subclass, in one line with file, field and remedy.
    """
    try:
        return msgspec.json.decode(read_file(path, error=error), type=kind)
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError) as cause:
        reason = " ".join(str(cause).split())[:_LONGEST_REASON]
        advice = f" {remedy[:1].upper()}{remedy[1:]}." if remedy else ""
        raise error(f"{path}: {reason}.{advice}") from None


def write_document(path: Path, document: msgspec.Struct) -> None:
    """Write a struct as JSON with sorted keys: equal documents are equal bytes."""
    # By way of builtins: msgspec would write NaN as null.
    write_json(path, msgspec.to_builtins(document, order="sorted"))
