"""Shares of a run: independent pieces divided among commands that share a folder.

Each command with a shard does its share of the pieces, in the folder that all share,
and lists them in ``shards/``. The same command without a shard does what is missing and
removes the lists: the folder is then as one command alone would have made it. Every
piece contains its own hash, so that edited ones are refused.
"""

import logging
import re
import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import msgspec

from sainet.runs.documents import read_document, write_document
from sainet.runs.errors import BadSetting, RunConflict
from sainet.runs.folders import RunFolder, open_run
from sainet.runs.manifest import MANIFEST, Manifest, code_versions

SHARDS = "shards"
_MOST_SHARDS = 100_000
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
    """What a shard has finished."""

    names: list[str]
    seal: str = ""  # hash of all other fields


@dataclass
class Share:
    """The share of one shard, in the folder that all shards of a run share."""

    out: Path
    shard: Shard
    _folder: RunFolder = field(repr=False)  # keeps its lock

    def add(self, *pieces: str) -> None:
        """List finished pieces, by their names."""
        path = self.out / SHARDS / f"{self.shard.number}-of-{self.shard.count}.json"
        known = _read(path).names if path.exists() else ()
        write_document(path, Pieces(list(dict.fromkeys((*known, *pieces)))))

    def finished(self) -> frozenset[str]:
        """Return the names of the pieces that any shard has finished by now."""
        return _finished(self.out)


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
    """
    folder = open_run(out / SHARDS, settings, finished_by="", shared=True)
    _check_versions(folder.path)
    share = Share(out, shard, folder)
    share.add()
    yield share


@dataclass
class Collected:
    """The pieces that shards have finished."""

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
    """
    if not (out / SHARDS).is_dir():
        return None
    folder = open_run(out / SHARDS, settings, finished_by="")
    _check_versions(folder.path)
    return Collected(out, _finished(out), len(_lists(out)), folder)


def _finished(out: Path) -> frozenset[str]:
    return frozenset(name for path in _lists(out) for name in _read(path).names)


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


def _lists(out: Path) -> list[Path]:
    return sorted((out / SHARDS).glob("*-of-*.json"))


def _read(path: Path) -> Pieces:
    remedy = "delete it, then run this shard again"
    return read_document(path, Pieces, error=RunConflict, remedy=remedy)
