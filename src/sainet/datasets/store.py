"""Stores of pushes: checked when they are opened, then read in parts."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, fields, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_args

import numpy as np
from jaxtyping import Int, UInt64

from sainet.datasets.pushes import hash_pushes, hashed_names
from sainet.datasets.schema import FORMAT_VERSION, Kind, StoreInfo, sizes, variables
from sainet.datasets.writer import ARRAYS, HASHES, chunk_files
from sainet.runs.documents import content_hash, read_json, readable
from sainet.runs.errors import BadInput, BadStore
from sainet.runs.folders import remake

if TYPE_CHECKING:
    import xarray


@dataclass(frozen=True)
class Store:
    """A complete, undamaged dataset of pushes."""

    path: Path
    info: StoreInfo
    rows: tuple[int, ...] | None = None  # of the pushes that are chosen; None: all

    def first(self, pushes: int) -> "Store":
        """Return the store with only its first pushes.

        Raises:
            BadInput: the store has fewer pushes.
        """
        if not 1 <= pushes <= self.info.pushes:
            raise BadInput(f"{self.path} has {self.info.pushes} pushes, not {pushes}.")
        return self if pushes == self.info.pushes else self.take(range(pushes))

    def take(self, rows: Iterable[int] | np.ndarray) -> "Store":
        """Return the store with only some of its pushes, in the given order.

        All pushes in their order give the same store with the same content hash.

        Raises:
            BadInput: no push is chosen, or the store does not contain one of them.
        """
        every = range(self.info.pushes) if self.rows is None else self.rows
        rows = [int(row) for row in rows]
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
        info = replace(self.info, pushes=len(chosen))
        return replace(self, info=info, rows=chosen)

    def of_group(self, name: str) -> "Store":
        """Return the pushes of one group.

        Raises:
            BadInput: the store has no such group.
        """
        if name not in self.info.groups:
            known = ", ".join(self.info.groups) or "none"
            raise BadInput(f"{self.path} has no group {name!r}; it has {known}.")
        groups = self.read(slice(None), ("group",))["group"]
        return self.take(np.flatnonzero(groups == self.info.groups.index(name)))

    def repeats(self) -> Int[np.ndarray, " push"]:
        """Return a number for each push; repeats of one push share their number.

        In stores without this information, no two pushes are repeats.
        """
        if not self.info.has_repeats:
            return np.arange(self.info.pushes)
        return self.read(slice(None), ("repeat",))["repeat"]

    @cached_property
    def _group(self) -> Any:  # noqa: ANN401
        import zarr

        return zarr.open_group(self.path / ARRAYS, mode="r")

    def read(
        self, pushes: slice, names: tuple[str, ...] | None = None
    ) -> dict[str, np.ndarray]:
        """Return some pushes of the named arrays (default: all) as NumPy arrays."""
        chosen = names or tuple(variables(self.info))
        rows = slice(*pushes.indices(self.info.pushes))
        if self._is_prefix:
            return {name: self._group[name][rows] for name in chosen}
        assert self.rows is not None
        picked = np.asarray(self.rows)[rows]
        return {name: self._group[name].oindex[picked] for name in chosen}

    @property
    def _is_prefix(self) -> bool:
        return self.rows is None or self.rows == tuple(range(len(self.rows)))

    def to_xarray(self) -> "xarray.Dataset":
        """Return the store as a lazy xarray dataset with dimensions and units."""
        import xarray

        whole = xarray.open_zarr(self.path / ARRAYS, consolidated=False, chunks=None)
        return whole if self.rows is None else whole.isel(push=list(self.rows))

    def push_hashes(self) -> UInt64[np.ndarray, " push"]:
        """Return the content hash of each push (see `datasets.pushes.hash_pushes`)."""
        names = hashed_names(self.info)
        parts = [
            hash_pushes(self.read(self.info.chunk_slice(index), names), self.info)
            for index in range(self.info.chunks)
        ]
        return np.concatenate(parts)

    @property
    def content(self) -> str:
        """The hash of the content: what a trained network's card records."""
        whole = content_hash((self.path / HASHES).read_bytes())
        if self.rows is None:
            return whole
        chosen = len(self.rows) if self._is_prefix else self.rows
        return content_hash(f"{whole} {chosen}".encode())


def open_store(path: Path | str, *, verify: bool = True) -> Store:
    """Return a dataset after checking that nothing is missing or changed.

    Args:
        path: folder made by `sainet generate` or `sainet import`.
        verify: whether to compare every file with its hash.

    Raises:
        BadStore: it is missing, unfinished, damaged or of a newer format.
    """
    folder = Path(path)
    with readable(folder, BadStore):
        return _open(folder, verify=verify)


def _open(folder: Path, *, verify: bool) -> Store:
    if not folder.is_dir():
        raise BadStore(
            f"{folder}: no such dataset; make one with 'sainet generate' or 'import'."
        )
    if not (folder / HASHES).is_file():
        raise BadStore(
            f"{folder / HASHES}: not found, so the dataset is not finished; run the "
            "command that made it again to resume."
        )
    listing = read_json(folder / HASHES, BadStore)
    _check_version(folder, folder / HASHES, listing)
    hashes = listing.get("files")
    if not isinstance(hashes, dict) or "zarr.json" not in hashes:
        raise BadStore(f"{folder / HASHES}: files is missing; {remake(folder)}.")
    info = _read_info(folder)
    _check_listing(folder, hashes, info)
    _check_files(folder, hashes, verify=verify)
    store = Store(folder, info)
    _check_shapes(store)
    return store


def _check_version(folder: Path, path: Path, found: dict[str, Any]) -> None:
    version = found.get("format_version")
    if version == FORMAT_VERSION:
        return
    if isinstance(version, int) and version > FORMAT_VERSION:
        raise BadStore(
            f"{path}: format_version is {version}, this sainet reads up to "
            f"{FORMAT_VERSION}; upgrade sainet."
        )
    raise BadStore(
        f"{path}: format_version is {version!r}, not {FORMAT_VERSION}; "
        f"{remake(folder)}."
    )


def _check_listing(folder: Path, hashes: dict[str, Any], info: StoreInfo) -> None:
    path = folder / HASHES
    for index in range(info.chunks):
        for name in chunk_files(info, index):
            if not isinstance(hashes.get(name), str):
                raise BadStore(f"{path}: {name} has no hash; {remake(folder)}.")


def _is_count(value: object) -> bool:
    return type(value) is int and value > 0


def _is_positive(value: object) -> bool:
    return isinstance(value, int | float) and 0 < value < float("inf")


def _are_names(value: object) -> bool:
    return isinstance(value, list) and all(isinstance(name, str) for name in value)


# Attributes that came later: what a store from before, which lacks them, means.
_LATER = {"has_repeats": False}
_SENSE: dict[str, Callable[[object], bool]] = {
    "kind": lambda value: value in get_args(Kind),
    "has_repeats": lambda value: isinstance(value, bool),
    **dict.fromkeys(("pushes", "bodies", "steps", "chunk_size"), _is_count),
    **dict.fromkeys(("time_step", "pusher_mass", "damping"), _is_positive),
    **dict.fromkeys(("assumed_engines", "groups", "published"), _are_names),
}


def _read_info(folder: Path) -> StoreInfo:
    path = folder / ARRAYS / "zarr.json"
    attributes = read_json(path, BadStore).get("attributes")
    if not isinstance(attributes, dict):
        raise BadStore(f"{path}: attributes are missing; {remake(folder)}.")
    _check_version(folder, path, attributes)
    names = {field.name for field in fields(StoreInfo)}
    attributes = _LATER | attributes
    missing = sorted(names - attributes.keys())
    if missing:
        raise BadStore(f"{path}: {missing[0]} is missing; {remake(folder)}.")
    known: dict[str, Any] = {name: attributes[name] for name in names}
    for name, makes_sense in _SENSE.items():
        if not makes_sense(known[name]):
            raise BadStore(f"{path}: {name} is {known[name]!r}; {remake(folder)}.")
    for name, value in known.items():
        known[name] = tuple(value) if isinstance(value, list) else value
    return StoreInfo(**known)


def _check_files(folder: Path, hashes: dict[str, Any], *, verify: bool) -> None:
    for name, known in hashes.items():
        path = folder / ARRAYS / name
        try:
            data = path.read_bytes() if verify else None
            present = data is not None or path.is_file()
        except OSError:
            data, present = None, False
        if not present:
            raise BadStore(f"{path}: missing; {remake(folder)}.")
        if data is not None and content_hash(data) != known:
            raise BadStore(
                f"{path}: truncated or changed since it was written; {remake(folder)}."
            )


def _check_shapes(store: Store) -> None:
    lengths = sizes(store.info)
    for name, variable in variables(store.info).items():
        path = store.path / ARRAYS / name
        if name not in store._group:
            raise BadStore(f"{path}: missing; {remake(store.path)}.")
        found = store._group[name].shape
        wanted = tuple(lengths[d] for d in variable.dimensions)
        if found != wanted:
            raise BadStore(
                f"{path}: shape is {found}, not {wanted}; {remake(store.path)}."
            )
