"""Datasets made from others: pushes picked, or what is known of them changed."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

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
    """Write what a function makes of a whole dataset, once.

    Args:
        store: read whole into memory.
        out: the run folder.
        settings: what the function does, as JSON values: they and the content of the
            store decide whether a folder holds the same already.
        change: returns the same arrays, changed, of fewer pushes or of more disks.

    Raises:
        RunConflict: the folder holds something else.
    """
    told = {"command": "derive", "data": store.content, **settings}
    folder = open_run(out, told, finished_by=HASHES)
    if not folder.is_finished:
        arrays = change(store.read(slice(None)))
        pushes, bodies = arrays["mass"].shape
        write_store(out, replace(store.info, pushes=pushes, bodies=bodies), arrays)
    return open_store(out)
