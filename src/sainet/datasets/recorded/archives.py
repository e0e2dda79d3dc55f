"""Files in folders and zips; zips are read in memory under caps, never extracted."""

import re
import zipfile
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

from sainet.runs.documents import read_file, readable
from sainet.runs.errors import BadTable

LARGEST_FILE = 16 << 20  # bytes
LARGEST_SUM = 4 << 30  # bytes
DENSEST = 100  # bytes out of one packed byte; text of numbers makes 3 to 5
_ENCRYPTED = 0x1  # a bit of a member's flags
_DRIVE = re.compile(r"[A-Za-z]:")
_LONGEST_NAME = 200  # characters in a message


@dataclass(frozen=True)
class ArchivedFile:
    """A file of a folder or a member of a zip."""

    path: Path  # of the zip, or of the file
    member: str | None  # the name within the zip
    size: int  # bytes, as declared
    packed_size: int  # bytes

    @property
    def name(self) -> str:
        """The name without folders."""
        return (self.member or self.path.name).rpartition("/")[2]

    def __str__(self) -> str:
        """Name the file in a message of one line."""
        return str(self.path) + (f": {_shown(self.member)}" if self.member else "")


def list_files(path: Path) -> list[ArchivedFile]:
    """Return the files of a zip, or of a folder and the zips in it, in a fixed order.

    Raises:
        BadTable: the path does not exist, or a zip is damaged or hostile.
    """
    with readable(path, BadTable):
        if path.is_dir():
            found = sorted(file for file in path.rglob("*") if file.is_file())
            return [each for file in found for each in _list_file(file)]
        if path.suffix.lower() != ".zip" or not path.is_file():
            raise BadTable(f"{path}: neither a .zip nor a folder; give one of them.")
        return _list_file(path)


def read_files(files: Sequence[ArchivedFile]) -> Iterator[tuple[ArchivedFile, bytes]]:
    """Yield each file and its content, one at a time.

    Raises:
        BadTable: a file is too large, packed too densely, encrypted or damaged.
    """
    for file in files:
        _check(file)
    left = LARGEST_SUM
    with ExitStack() as stack:
        zips: dict[Path, zipfile.ZipFile] = {}
        for file in files:
            with _reported(file):
                if file.member and file.path not in zips:
                    zips[file.path] = stack.enter_context(zipfile.ZipFile(file.path))
                data = _read(file, zips.get(file.path))
            left -= len(data)
            if len(data) > LARGEST_FILE or left < 0:
                raise _too_large(file)
            yield file, data


def _list_file(path: Path) -> list[ArchivedFile]:
    if path.suffix.lower() != ".zip":
        with _reported(path):
            size = path.stat().st_size
        return [ArchivedFile(path, None, size, size)]
    with _reported(path), zipfile.ZipFile(path) as archive:
        return [
            ArchivedFile(path, info.filename, info.file_size, info.compress_size)
            for info in archive.infolist()
            if _is_plain(path, info)
        ]


def _is_plain(path: Path, info: zipfile.ZipInfo) -> bool:
    """Return whether a member is a file; refuse one that would leave the folder."""
    name = info.orig_filename  # as in the zip; Python changes `filename`
    folders = name.split("/")
    if name.startswith("/") or ".." in folders or _DRIVE.match(name):
        raise BadTable(f"{path}: {_shown(name)} leaves its folder; do not trust this.")
    if not name or "\\" in name or "\0" in name:
        raise BadTable(f"{path}: {_shown(name)} is not a file name; pack it again.")
    if info.flag_bits & _ENCRYPTED:
        raise BadTable(f"{path}: {_shown(name)} is encrypted; give it unlocked.")
    return not info.is_dir()


def _check(file: ArchivedFile) -> None:
    if file.size > LARGEST_FILE:
        raise _too_large(file)
    if file.size > DENSEST * max(file.packed_size, 1):
        raise BadTable(
            f"{file} is packed more than {DENSEST} times, unlike recordings; "
            "do not trust it."
        )


def _too_large(file: ArchivedFile) -> BadTable:
    return BadTable(
        f"{file} is too large: a file may have {LARGEST_FILE >> 20} MB, all of them "
        f"{LARGEST_SUM >> 30} GB; give fewer at a time."
    )


def _read(file: ArchivedFile, archive: zipfile.ZipFile | None) -> bytes:
    """Read at most one byte more than was declared."""
    if archive is None or file.member is None:
        return read_file(file.path, most=file.size, error=BadTable)
    info = archive.getinfo(file.member)
    # Python's other unpackers may return any amount at once for a few bytes.
    if info.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
        raise BadTable(f"{file} is packed in an unusual way; pack it again.")
    with archive.open(info) as stream:
        return stream.read(file.size + 1)


@contextmanager
def _reported(source: object) -> Iterator[None]:
    """Raise `BadTable` naming the source for any error."""
    try:
        yield
    except BadTable:
        raise
    except OSError as error:
        reason = error.strerror or _shown(str(error))
        raise BadTable(f"{source}: cannot be read ({reason}).") from None
    # Python's reader raises arbitrary exceptions on damaged zips.
    except Exception as error:
        reason = _shown(str(error) or type(error).__name__)
        raise BadTable(f"{source}: is damaged ({reason}); download it again.") from None


def _shown(name: str) -> str:
    """Return a name from a hostile zip on one line."""
    return repr(name[:_LONGEST_NAME])
