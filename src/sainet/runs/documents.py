"""Documents on disk: typed JSON, hashes and atomic writes."""

import errno
import hashlib
import json
import os
import stat
import uuid
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, TypeVar

import msgspec

from sainet.runs.errors import BadInput, shown

LARGEST_DOCUMENT = 64 << 20  # bytes
_LONGEST_REASON = 200  # characters of a message that quote a file
UNSEALED = 8 * "unsealed"  # in the place of the seal, before a file is sealed
AGAIN = "delete it, then run the same command again"
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
    if is_full(error):
        return BadInput(
            f"{path}: the disk is full; make room, then run the same command again."
        )
    return BadInput(f"{path}: cannot be written ({error.strerror}); choose another.")


def is_full(error: OSError) -> bool:
    """Return whether a write failed for want of room."""
    return error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)


def write_bytes(path: Path, data: bytes) -> None:
    """Write a file atomically."""
    with atomic_path(path) as temporary:
        temporary.write_bytes(data)


def write_json(path: Path, value: object) -> None:
    """Write a JSON file atomically."""
    write_bytes(path, to_json(value).encode())


def write_first(path: Path, value: object) -> None:
    """Write a JSON file atomically, unless another process has written it by then."""
    staged = path.with_name(f".{path.name}.{uuid.uuid4().hex}.first.partial")
    write_json(staged, value)
    try:
        os.link(staged, path)
    except FileExistsError:
        pass
    except OSError:  # a file system without hard links
        os.replace(staged, path)
    finally:
        staged.unlink(missing_ok=True)


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
        value = msgspec.json.decode(read_file(path, error=error))
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError) as cause:
        raise error(f"{path}: cannot be read as JSON ({_reason(cause)}).") from None
    if not isinstance(value, dict):
        raise error(f"{path}: must hold a JSON object, not a {type(value).__name__}.")
    return value


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
        with open(path, "rb", opener=_open_at_once) as file:
            found = os.fstat(file.fileno())
            if not stat.S_ISREG(found.st_mode):
                raise error(f"{path}: not a regular file; give a file.")
            data = file.read(most + 1)
    except FileNotFoundError:
        raise error(f"{path}: no such file.") from None
    except (OSError, ValueError) as cause:
        reason = getattr(cause, "strerror", None) or cause
        raise error(f"{path}: cannot be read ({reason}).") from None
    if len(data) > most:
        raise error(f"{path}: larger than {most} bytes, which is too large to read.")
    return data


def _open_at_once(path: str, flags: int) -> int:
    return os.open(path, flags | os.O_NONBLOCK)


def read_document(
    path: Path,
    kind: type[T],
    *,
    decode: Callable[..., T] = msgspec.json.decode,
    error: type[BadInput] = BadInput,
    remedy: str = "",
) -> T:
    """Return a document as a msgspec struct, with every field checked.

    Args:
        path: of the file.
        kind: the struct. Where it has a field `format_version`, the default of that
            field is the only version that is read (JSON). A field `seal` must be the
            hash of all others.
        decode: for another format than JSON, for example `msgspec.toml.decode`.
        error: to raise.
        remedy: what the user can do, without a full stop: "train it again".

    Raises:
        BadInput: or the given subclass, in one line with file, field and remedy.
    """
    data = read_file(path, error=error)
    try:
        _check_version(path, data, kind, error)
        found = decode(data, type=kind)
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError) as cause:
        raise error(f"{path}: {_reason(cause)}.{_sentence(remedy)}") from None
    if isinstance(found, msgspec.Struct) and hasattr(found, "seal"):
        fields = msgspec.json.decode(data)
        seal, wanted = str(fields.get("seal", "")), _seal_of(fields)
        check_seal(path, seal, wanted, error=error, remedy=remedy)
        found = msgspec.structs.replace(found, seal="")  # of the file, not the value
    return found


def _sentence(remedy: str) -> str:
    return f" {remedy[:1].upper()}{remedy[1:]}." if remedy else ""


def write_document(path: Path, document: msgspec.Struct) -> None:
    """Write a struct as JSON with sorted keys: equal documents are equal bytes.

    A field `seal` becomes the hash of all others, which `read_document` checks.
    """
    write_json(path, sealed_fields(document))


def sealed_fields(document: msgspec.Struct) -> dict[str, Any]:
    """Return the fields of a struct as JSON values; the field `seal` is filled."""
    # By way of builtins: msgspec would write NaN as null.
    fields = msgspec.to_builtins(document, order="sorted")
    if hasattr(document, "seal"):
        fields["seal"] = _seal_of(fields)
    return fields


def _seal_of(fields: Mapping[str, object]) -> str:
    """Return the hash of all fields except the seal itself."""
    others = {name: value for name, value in fields.items() if name != "seal"}
    return content_hash(to_json(others).encode())


def sealed(data: bytes) -> bytes:
    """Return a file with its hash in the place of `UNSEALED`, which it contains."""
    return data.replace(UNSEALED.encode(), content_hash(data).encode(), 1)


def check_sealed(path: Path, data: bytes, seal: str) -> None:
    """Raise `BadInput` unless a file is as `sealed` returned it, with this seal."""
    unsealed = data.replace(seal.encode(), UNSEALED.encode(), 1)
    check_seal(path, seal, content_hash(unsealed))


def check_seal(
    path: Path,
    found: str,
    wanted: str,
    *,
    error: type[BadInput] = BadInput,
    remedy: str = AGAIN,
) -> None:
    """Raise unless a file has the seal that it must have.

    Raises:
        BadInput: or the given subclass: it was edited, or has no seal.
    """
    if found != wanted:
        edited = "the file was edited"
        why = edited if found else f"missing: {edited}, or is of an earlier sainet"
        raise error(f"{path}: seal: {why}.{_sentence(remedy)}")


def checked(document: T, where: object) -> T:
    """Return a struct whose fields were checked: constructors do not check them.

    Args:
        document: the struct.
        where: the message begins with it.

    Raises:
        BadInput: a field has a wrong type or is out of range.
    """
    try:
        return msgspec.convert(msgspec.to_builtins(document), type(document))
    except msgspec.MsgspecError as cause:
        raise BadInput(f"{where}: {_reason(cause)}.") from None


class _Versioned(msgspec.Struct):
    format_version: int


def _check_version(path: Path, data: bytes, kind: type, error: type[BadInput]) -> None:
    if "format_version" not in getattr(kind, "__struct_fields__", ()):
        return
    defaults = {each.name: each.default for each in msgspec.structs.fields(kind)}
    known = defaults["format_version"]
    found = msgspec.json.decode(data, type=_Versioned).format_version
    if found == known:
        return
    age = "a later" if found > known else "an earlier"
    remedy = "upgrade sainet" if found > known else "make it again"
    raise error(
        f"{path}: format_version is {found}, not {known}: it was made by {age} version "
        f"of sainet; {remedy}."
    )


def _reason(cause: Exception) -> str:
    """Return why a document was refused, with the field first."""
    if isinstance(cause, RecursionError):
        return "nested too deeply"
    reason = shown(" ".join(str(cause).split()), _LONGEST_REASON)
    text, _, field = reason.partition(" - at `")
    field = field.strip("`").removeprefix("$").removeprefix(".")
    return f"{field}: {text[:1].lower()}{text[1:]}" if field else text
