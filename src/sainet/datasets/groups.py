"""Groups of recorded pushes: those of one surface and speed, as they were imported."""

from collections.abc import Iterable

import numpy as np

from sainet.datasets.store import Store


def groups_of(stores: Iterable[Store]) -> tuple[str, ...]:
    """Return the names of the groups to which pushes belong; none of simulated ones."""
    found: set[str] = set()
    for store in stores:
        if names := store.info.groups:
            codes = np.unique(store.read(slice(None), ("group",))["group"])
            found |= {names[code] for code in codes}
    return tuple(sorted(found))
