"""Anybody's own pushes: a table of poses over time, and what the bodies are."""

import logging
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from sainet.datasets.recorded.arrays import (
    STORED_ENGINES,
    SceneProperties,
    write_pushes,
)
from sainet.datasets.recorded.folder import make_once
from sainet.datasets.recorded.table.body_properties import (
    BodyProperties,
    read_properties,
)
from sainet.datasets.recorded.table.file import read_rows, read_table_bytes
from sainet.datasets.recorded.table.pushes import to_pushes
from sainet.datasets.recorded.table.rows import TableRows
from sainet.datasets.store import Store
from sainet.runs.documents import content_hash
from sainet.runs.errors import BadTable

_log = logging.getLogger(__name__)


def import_table(
    path: Path,
    properties: Path,
    out: Path,
    *,
    contact_friction: float | None = None,
) -> Store:
    """Make a store of a table with one row for each push, time and body.

    Args:
        path: a .csv or .parquet file; its schema is in `docs/importing.md`.
        properties: a TOML file of masses, radii and frictions.
        out: the run folder; it appears when the store is whole and not before.
        contact_friction: between bodies and with the pusher, in the place of what the
            properties say.

    Raises:
        BadTable: with the file, the row (line of the file, from 1) and the way out.
        MissingExtra: the table is Parquet, and pyarrow is not installed.
        RunConflict: the folder holds something else; nothing was touched.
        BadInput: a friction is negative or no number, or the disk is full.
    """
    path = Path(path)
    known = read_properties(Path(properties), contact_friction)
    data = read_table_bytes(path)
    table = read_rows(path, data)
    bodies = _present(table, known, Path(properties))
    pushes = to_pushes(table, bodies)
    scene = SceneProperties(
        mass=bodies.mass,
        radius=bodies.radius,
        pusher_radius=bodies.pusher_radius,
        contact_friction=bodies.contact_friction,
        table_friction=bodies.table_friction,
    )
    config = _config(path, data, bodies, scene)
    return make_once(
        Path(out), config, lambda folder: write_pushes(folder, pushes, scene)
    )


def _present(table: TableRows, known: BodyProperties, path: Path) -> BodyProperties:
    """Return the properties of the bodies that the table has, in their order."""
    named = table.names["body"]
    for code, name in enumerate(named):
        if name not in known.names:
            row = int(np.argmax(table.codes["body"] == code))
            raise _without_properties(table, row, name, path)
    kept = [index for index, name in enumerate(known.names) if name in named]
    for name in sorted(set(known.names) - set(named)):
        _log.warning("%s: body %r is in no push of %s", path, name, table.path)
    return replace(
        known,
        names=tuple(known.names[index] for index in kept),
        mass=tuple(known.mass[index] for index in kept),
        radius=tuple(known.radius[index] for index in kept),
    )


def _without_properties(table: TableRows, row: int, name: str, path: Path) -> BadTable:
    return table.bad(
        row, f"body {name[:40]!r} has no properties; add [bodies.NAME] to {path}"
    )


def _config(
    path: Path, data: bytes, bodies: BodyProperties, scene: SceneProperties
) -> dict[str, Any]:
    """Return what decides the store: a changed file is a changed setting."""
    return {
        "command": "import table",
        "source": path.name,
        "source_sha256": content_hash(data),
        "bodies": list(bodies.names),
        "assumed_engines": list(STORED_ENGINES),
        **scene.to_dict(),
    }
