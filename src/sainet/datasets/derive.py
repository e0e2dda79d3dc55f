"""Datasets derived from others: selected or modified pushes."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from msgspec import structs

from sainet.datasets.schema import Arrays
from sainet.datasets.store import Store, open_store
from sainet.datasets.writer import HASHES, write_store
from sainet.runs.folders import open_run


def derive(
    store: Store,
    out: Path,
    settings: dict[str, Any],
    change: Callable[[Arrays], Arrays],
) -> Store:
    """Return a dataset that a function makes of another dataset; written once.

    Args:
        store: read whole into memory.
        out: the run folder.
        settings: settings of the function, as JSON values: with the content of the
            store, they identify the derived dataset.
        change: returns the changed arrays, with fewer pushes or more disks.

    Raises:
        RunConflict: the folder belongs to another run.
    """
    known = {"command": "derive", "data": store.content, **settings}
    folder = open_run(out, known, finished_by=HASHES)
    if not folder.is_finished:
        arrays = change(store.read(slice(None)))
        pushes, bodies = arrays["mass"].shape
        write_store(
            out, structs.replace(store.info, pushes=pushes, bodies=bodies), arrays
        )
    return open_store(out)
