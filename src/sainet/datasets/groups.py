"""Groups of recorded pushes: those of one surface and speed, as they were imported.

The name of a group is that of its surface, a hyphen and a speed: ``abs-10``. A name
without a number at its end is that of a surface.
"""

import re
from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from sainet.datasets.store import Store

_SPEED = re.compile(r"-\d+(\.\d+)?\Z")


def surface_of(group: str) -> str:
    """Return the surface of a group: ``abs`` of ``abs-10``."""
    return _SPEED.sub("", group) or group


def groups_of(stores: "Iterable[Store]") -> tuple[str, ...]:
    """Return the names of the groups to which pushes belong; none of simulated ones."""
    found: set[str] = set()
    for store in stores:
        if names := store.info.groups:
            codes = np.unique(store.read(slice(None), ("group",))["group"])
            found |= {names[code] for code in codes}
    return tuple(sorted(found))
