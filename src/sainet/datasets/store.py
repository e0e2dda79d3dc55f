"""Stores of pushes: checked when they are opened, then read in parts."""

import hashlib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Int, UInt64
from msgspec import structs

from sainet.datasets import schema
from sainet.datasets.check import check_files, check_values, read_info
from sainet.datasets.groups import surface_of
from sainet.runs.digests import BYTES
from sainet.runs.documents import content_hash, read_document, read_file, readable
from sainet.runs.errors import BadInput, BadStore, hint, shown
from sainet.runs.folders import CONFIG, remake
from sainet.runs.manifest import MANIFEST
from sainet.scenes.quantities import require_count


@dataclass(frozen=True)
class Store:
    """A complete, undamaged dataset of pushes."""

    path: Path
    info: schema.StoreInfo
    rows: tuple[int, ...] | None = None  # of the chosen pushes; None: all

    def first(self, pushes: int) -> "Store":
        """Return the store with only its first pushes.

        Raises:
            BadInput: the store has fewer pushes.
        """
        require_count("pushes", pushes)
        if pushes > self.info.pushes:
            raise BadInput(f"{self.path} has {self.info.pushes} pushes, not {pushes}.")
        return self if pushes == self.info.pushes else self.take(range(pushes))

    def take(self, rows: Iterable[int] | np.ndarray) -> "Store":
        """Return the store with only some of its pushes, in the given order.

        All pushes in their order give the same store with the same content hash.

        Raises:
            BadInput: no push is chosen, the store does not contain one of them, or they
                are no indices: a mask, for example.
        """
        every = range(self.info.pushes) if self.rows is None else self.rows
        rows = _indices(rows)
        if not rows:
            raise BadInput(f"{self.path}: no push was chosen; choose at least one.")
        if not 0 <= min(rows) <= max(rows) < self.info.pushes:
            raise BadInput(
                f"{self.path} has {self.info.pushes} pushes; there is no push "
                f"{max(rows) if min(rows) >= 0 else min(rows)}."
            )
        if rows == list(range(self.info.pushes)):
            return self
        chosen = tuple(every[row] for row in rows)
        info = structs.replace(self.info, pushes=len(chosen))
        return replace(self, info=info, rows=chosen)

    def of_group(self, name: str) -> "Store":
        """Return the pushes of one group, or of all groups of one surface.

        Raises:
            BadInput: the store has no such group.
        """
        names = self.info.groups
        chosen = [code for code, known in enumerate(names) if known == name] or [
            code for code, known in enumerate(names) if surface_of(known) == name
        ]
        if not chosen:
            raise BadInput(
                f"{self.path} has no group '{shown(name)}'{hint(name, names)}; it has "
                f"{shown(', '.join(names) or 'none', 120)}."
            )
        groups = self.read(slice(None), ("group",))["group"]
        return self.take(np.flatnonzero(np.isin(groups, chosen)))

    def repeats(self) -> Int[np.ndarray, " push"]:
        """Return a number for each push; repeats of one push share their number.

        Pushes that are alike are repeats as well: one push that is stored twice.
        """
        first = self.first_alike()
        kinds = np.arange(len(first))
        if self.info.has_repeats:
            kinds = self.read(slice(None), ("repeat",))["repeat"]
        for row in np.flatnonzero(first < np.arange(len(first))):
            kinds = np.where(kinds == kinds[row], kinds[first[row]], kinds)
        return kinds

    def first_alike(self) -> Int[np.ndarray, " push"]:
        """Return the first push that starts and is commanded as each push."""
        hashes = self.push_hashes()
        _, first, place = np.unique(hashes, return_index=True, return_inverse=True)
        return first[place]

    @cached_property
    def _group(self) -> Any:  # noqa: ANN401
        import zarr

        # Consolidated metadata would be a second, unchecked description.
        folder = self.path / schema.ARRAYS
        return zarr.open_group(folder, mode="r", use_consolidated=False)

    def read(
        self, pushes: slice, names: tuple[str, ...] | None = None
    ) -> dict[str, np.ndarray]:
        """Return some pushes of the named arrays (default: all) as NumPy arrays.

        Raises:
            BadStore: a chunk is damaged, or a value is out of range.
        """
        chosen = names or tuple(schema.variables(self.info))
        rows = np.arange(self.info.pushes)[pushes]
        if not self._is_prefix:
            rows = np.asarray(self.rows)[rows]
        arrays = {name: self._read_rows(name, rows) for name in chosen}

        def read(name: str) -> np.ndarray:
            return arrays[name] if name in arrays else self._read_rows(name, rows)

        check_values(self.path, self.info, rows, arrays, read)
        return arrays

    def _read_rows(self, name: str, rows: np.ndarray) -> np.ndarray:
        is_range = len(rows) > 0 and rows[-1] - rows[0] == len(rows) - 1
        try:
            array = self._group[name]
            if is_range and np.all(np.diff(rows) == 1):
                return array[rows[0] : rows[-1] + 1]
            return array.oindex[rows]
        except (RuntimeError, ValueError, TypeError, OSError, MemoryError) as error:
            raise BadStore(
                f"{self.path / schema.ARRAYS / name}: a chunk is damaged "
                f"({shown(error)}); {remake(self.path)}."
            ) from None

    @property
    def _is_prefix(self) -> bool:
        return self.rows is None or self.rows == tuple(range(len(self.rows)))

    def push_hashes(self) -> UInt64[np.ndarray, " push"]:
        """Return a hash of where each push started and of its command.

        A push has the same hash in every store: it does not depend on assumptions of an
        import (masses, frictions), simulator predictions or the other pushes.
        """
        info = self.info
        known = {
            n: each for n, each in schema.variables(info).items() if each.is_hashed
        }
        parts = [info.chunk_slice(index) for index in range(info.chunks)]
        read = (self.read(part, tuple(known)) for part in parts)
        return np.concatenate([_hash_pushes(arrays, known) for arrays in read])

    @property
    def content(self) -> str:
        """The hash of the content, as model cards record it."""
        whole = content_hash(read_file(self.path / schema.HASHES, error=BadStore))
        if self.rows is None:
            return whole
        chosen = len(self.rows) if self._is_prefix else self.rows
        return content_hash(f"{whole} {chosen}".encode())


def last_known(
    values: Float[np.ndarray, "push time *rest"], known: Bool[np.ndarray, "push time"]
) -> Float[np.ndarray, "push *rest"]:
    """Return the last known values of each push; NaN where none is known."""
    last = known.shape[1] - 1 - np.argmax(known[:, ::-1], axis=1)
    is_known = known.any(axis=1).reshape(-1, *[1] * (values.ndim - 2))
    return np.where(is_known, values[np.arange(len(values)), last], np.nan)


def _indices(rows: Iterable[int] | np.ndarray) -> list[int]:
    """Return rows as whole numbers; a mask would otherwise choose pushes 0 and 1.

    Raises:
        BadInput: they are of another type, or have other axes.
    """
    found = np.asarray([*rows] if isinstance(rows, Iterable) else rows)  # pyright: ignore
    if found.ndim != 1 or (found.size and found.dtype.kind not in "iu"):
        raise BadInput(
            f"`rows` is {shown(found)}; it must be whole numbers, the indices of "
            "pushes (of a mask, use `np.flatnonzero`)."
        )
    return found.tolist()


def _hash_pushes(
    arrays: schema.Arrays, known: Mapping[str, schema.Variable]
) -> UInt64[np.ndarray, " push"]:
    hashes = np.empty(len(arrays["steps"]), np.uint64)
    for row, count in enumerate(arrays["steps"]):
        digest = hashlib.sha256(int(count).to_bytes(8, "little"))
        for name in filter(lambda name: name != "steps", known):
            # Beyond its end a push is filled up to the longest push of the store.
            stop = count if "time" in known[name].dimensions else None
            value = arrays[name][row][:stop]
            digest.update(np.ascontiguousarray(value, "<f4").tobytes())
        hashes[row] = int.from_bytes(digest.digest()[:BYTES], "big")
    return hashes


def open_part(path: Path, group: str | None, pushes: int | None = None) -> Store:
    """Return a dataset with the pushes of one group, and the first of these only.

    Args:
        path: see `open_store`.
        group: name of the group; None: all groups.
        pushes: number of pushes; None: all.

    Raises:
        BadStore: see `open_store`.
        BadInput: there is no such group, or it has fewer pushes.
    """
    store = open_store(path)
    store = store if group is None else store.of_group(group)
    return store if pushes is None else store.first(pushes)


_UNKNOWN = "the origin of the pushes is unknown; make the dataset in a new folder"
_NEEDED = {
    schema.HASHES: "the dataset is unfinished; run the command that made it again to "
    "resume it",
    CONFIG: _UNKNOWN,
    MANIFEST: _UNKNOWN,
}


def open_store(path: Path | str, *, verify: bool = True) -> Store:
    """Return a dataset after checking that nothing is missing or changed.

    Values are checked when they are read.

    Args:
        path: folder that `sainet generate`, `import` or `add-bystander` made, `dataset`
            of `record`, or `train` or `test` of `split`.
        verify: whether to compare every file with its hash.

    Raises:
        BadStore: it is missing, unfinished, damaged or of another format.
    """
    folder = Path(path)
    with readable(folder, BadStore):
        if not folder.is_dir():
            raise BadStore(
                f"{folder}: no such dataset; make one with 'sainet generate' or "
                "'import'."
            )
        inside = sorted(str(each.parent) for each in folder.glob(f"*/{schema.HASHES}"))
        if inside and not (folder / schema.HASHES).exists():
            raise BadStore(f"{folder}: not a dataset; give {' or '.join(inside[:2])}.")
        for name, why in _NEEDED.items():
            if not (folder / name).exists():
                raise BadStore(f"{folder / name}: missing, so {why}.")
    remedy = remake(folder)
    listing = read_document(
        folder / schema.HASHES, schema.Listing, error=BadStore, remedy=remedy
    )
    info = read_info(folder)
    check_files(folder, info, listing.files, verify=verify)
    return Store(folder, info)
