"""Shares of a run: independent pieces divided among commands that share a folder.

Each command with a shard does its share of the pieces, in the folder that all share,
and lists them with their hashes in ``shards/``. The same command without a shard
checks them, does what is missing and removes the lists: the folder is then as one
command alone would have made it.
"""

import logging
import re
import shutil
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import msgspec

from sainet.runs.documents import (
    content_hash,
    read_document,
    read_file,
    write_document,
)
from sainet.runs.errors import BadInput, BadSetting, RunConflict
from sainet.runs.folders import RunFolder, open_run
from sainet.runs.manifest import MANIFEST, Manifest, code_versions

SHARDS = "shards"
_MOST_SHARDS = 100_000
_LARGEST_FILE = 1 << 34  # bytes
_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Shard:
    """One of several equal shares of the independent pieces of a run."""

    number: int  # from 1
    count: int

    @classmethod
    def parse(cls, text: str) -> "Shard":
        """Return the shard that a text names: ``3/8`` is the third of eight.

        Raises:
            BadSetting: the text names none.
        """
        found = re.fullmatch(r"([0-9]{1,6})/([0-9]{1,6})", text)
        number, count = map(int, found.groups()) if found else (0, 0)
        if not 1 <= number <= count <= _MOST_SHARDS:
            raise BadSetting(
                "shard", text, "a number and a count, from 1/N to N/N, for example 3/8"
            )
        return cls(number, count)

    def takes(self, index: int) -> bool:
        """Return whether a piece belongs to this shard; pieces are counted from 0."""
        return index % self.count == self.number - 1

    def own(self, count: int) -> list[int]:
        """Return the indices of its pieces, of so many."""
        return [index for index in range(count) if self.takes(index)]

    def __str__(self) -> str:
        """Return the text that `parse` reads."""
        return f"{self.number}/{self.count}"


class Pieces(msgspec.Struct, frozen=True):
    """What a shard has finished: files of each piece, and their SHA-256."""

    files: dict[str, dict[str, str]]  # by the name of the piece; paths in the folder


@dataclass
class Share:
    """The share of one shard, in the folder that all shards of a run share."""

    out: Path
    shard: Shard
    pieces: dict[str, dict[str, str]]
    _folder: RunFolder = field(repr=False)  # keeps its lock

    def add(self, piece: str, files: Iterable[Path]) -> None:
        """List a finished piece: a later change of its files is noticed."""
        self.pieces[piece] = {
            path.relative_to(self.out).as_posix(): _hash(path) for path in files
        }
        write_document(_list(self.out, self.shard), Pieces(self.pieces))

    def finished(self) -> frozenset[str]:
        """Return the names of the pieces that any shard has finished by now."""
        return frozenset(
            name for path in _lists(self.out) for name in _read(path).files
        )


@contextmanager
def open_share(
    out: Path, settings: Mapping[str, object], shard: Shard
) -> Iterator[Share]:
    """Yield the share of a shard; other shards may work in the folder meanwhile.

    Args:
        out: the folder of the run.
        settings: JSON values, equal for all shards.
        shard: whose pieces are done here.

    Raises:
        RunConflict: the folder has shards of other settings or versions, or a command
            without a shard is at work there.
        BadInput: a file was changed after this shard had finished it.
    """
    folder = open_run(out / SHARDS, settings, finished_by="", shared=True)
    _check_versions(folder.path)
    path = _list(out, shard)
    pieces = _read(path).files if path.exists() else {}
    for files in pieces.values():
        check_files(out, files)
    share = Share(out, shard, dict(pieces), folder)
    if not path.exists():
        write_document(path, Pieces(share.pieces))
    yield share


@dataclass
class Collected:
    """The pieces that shards have finished, as far as their files are unchanged."""

    out: Path
    pieces: frozenset[str]
    shards: int
    _folder: RunFolder = field(repr=False)  # keeps its lock

    def tell(self, missing: int, total: int) -> None:
        """Tell the user how many pieces no shard has finished."""
        if missing:
            _log.warning(
                "%s: %d of %d pieces are missing from %d shards; they are made now.",
                *(self.out, missing, total, self.shards),
            )

    def clear(self) -> None:
        """Remove the lists of the shards: the run is finished."""
        shutil.rmtree(self._folder.path, ignore_errors=True)


def collect(out: Path, settings: Mapping[str, object]) -> Collected | None:
    """Return what shards have finished in a folder; None without shards.

    Raises:
        RunConflict: the shards have other settings or versions, or one is at work.
        BadInput: a file was changed after a shard had finished it.
    """
    if not (out / SHARDS).is_dir():
        return None
    folder = open_run(out / SHARDS, settings, finished_by="")
    _check_versions(folder.path)
    lists = _lists(out)
    pieces: set[str] = set()
    for path in lists:
        for piece, files in _read(path).files.items():
            check_files(out, files)
            pieces.add(piece)
    return Collected(out, frozenset(pieces), len(lists), folder)


def check_files(out: Path, files: Mapping[str, str]) -> None:
    """Raise unless files are as they were when a shard finished them.

    Raises:
        BadInput: one was changed or removed.
    """
    for name, digest in files.items():
        path = out / name
        if not path.is_file() or _hash(path) != digest:
            raise BadInput(
                f"{path}: was changed after a shard had finished it; restore it, or "
                f"delete {out}, then run all shards again."
            )


def files_in(folder: Path, without: Sequence[str] = ()) -> list[Path]:
    """Return all files of a finished piece, but those in subfolders of some names."""
    return sorted(
        path
        for path in folder.rglob("*")
        if path.is_file() and not set(path.relative_to(folder).parts) & set(without)
    )


def _check_versions(folder: Path) -> None:
    """Raise `RunConflict` if shards were made with other versions, or another commit.

    What a shard of another version made could differ, and would be mixed in.
    """
    known = read_document(folder / MANIFEST, Manifest, error=RunConflict)
    before = {**known.versions, "git_commit": known.git_commit}
    for name, version in code_versions().items():
        if before.get(name) != version:
            raise RunConflict(
                f"{folder / MANIFEST}: {name} is {before.get(name)}, not {version}; "
                "use the version that began, or choose another `out`."
            )


def _list(out: Path, shard: Shard) -> Path:
    return out / SHARDS / f"{shard.number}-of-{shard.count}.json"


def _lists(out: Path) -> list[Path]:
    return sorted((out / SHARDS).glob("*-of-*.json"))


def _read(path: Path) -> Pieces:
    remedy = "delete it, then run this shard again"
    return read_document(path, Pieces, error=RunConflict, remedy=remedy)


def _hash(path: Path) -> str:
    return content_hash(read_file(path, most=_LARGEST_FILE))
