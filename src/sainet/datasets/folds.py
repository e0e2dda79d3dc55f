"""Ways to divide recorded pushes into folds: what a model's test pushes lack.

By kind of push, folds leave out whole sets of repeats, and by chain also what a chain
links to them. Blocked folds leave out a part of the table, of the directions, of the
sides of the disk or of the time of recording, so that a model must extrapolate.
"""

from collections.abc import Callable, Mapping

import numpy as np
from jaxtyping import Float, Int

from sainet.datasets import Scheme
from sainet.datasets.chains import linked
from sainet.datasets.facts import pushed_disk
from sainet.datasets.schema import Arrays
from sainet.datasets.splits import fold_of_push
from sainet.datasets.store import Store
from sainet.runs.errors import BadStore

BLOCKED: tuple[Scheme, ...] = ("place", "direction", "side", "order")
_DIGITS = 6  # of values that are equal
# Values (m, rad, pushes) that differ by less are one place, direction or side.
_ALIKE: Mapping[Scheme, float] = {
    "place": 1e-3,
    "direction": 0.02,
    "side": 0.02,
    "order": 1,
}


def folds_by(
    store: Store, scheme: Scheme, count: int, rows: Int[np.ndarray, " some"]
) -> Int[np.ndarray, " some"]:
    """Return the fold of some pushes, from 0; copies of one push share their fold.

    Args:
        store: of all pushes; repeats and chains are looked for in all of them.
        scheme: how the pushes are divided.
        count: of the folds.
        rows: of the pushes; blocks are of them alone.

    Raises:
        BadStore: the pushes do not suffice for so many folds.
    """
    if scheme in _KINDS:
        kinds = _KINDS[scheme](store)
        owner, parts = fold_of_push(kinds, count)[rows], len(np.unique(kinds[rows]))
    else:
        part = store.take(rows)
        values, first = _values(part, scheme), part.first_alike()
        owner = _blocks(values, count)[first]
        parts = len(np.unique(np.rint(values[first] / _ALIKE[scheme])))
    if min(parts, len(np.unique(owner))) < count:
        fewer = "take fewer folds, " if parts > 1 else "take "
        raise BadStore(
            f"{store.path}: {len(rows)} pushes, {parts} of them different by {scheme}, "
            f"do not fill {count} folds; {fewer}another division or more pushes."
        )
    return owner


_KINDS: Mapping[Scheme, Callable[[Store], Int[np.ndarray, " push"]]] = {
    "kind": Store.repeats,
    "chain": linked,
}


def _values(store: Store, scheme: Scheme) -> Float[np.ndarray, " push"]:
    """Return a number for each push; blocks are ranges of it."""
    names = ("initial", "radius", "initial_pusher", "command_position", "steps")
    arrays = store.read(slice(None), names)
    place = pushed_disk(arrays)[:, :2]
    if scheme == "place":
        # Along the direction in which places are spread most.
        axes = np.linalg.svd(place - place.mean(axis=0), full_matrices=False)[2]
        return place @ axes[0]
    if scheme == "order":
        return np.arange(len(place), dtype=float)
    angles = _direction(arrays) if scheme == "direction" else _side(arrays)
    return _from_widest_gap(angles)


def _from_widest_gap(angles: Float[np.ndarray, " push"]) -> Float[np.ndarray, " push"]:
    """Return angles (rad) counted from the end of the widest gap between them.

    So no block of neighbours is cut where the angle jumps by a full turn.
    """
    turn = 2 * np.pi
    angles = np.mod(angles, turn)
    around = np.sort(angles)
    gaps = np.diff(around, append=around[0] + turn)
    first = around[(np.argmax(gaps) + 1) % len(around)]
    return np.mod(angles - first, turn)


def _direction(arrays: Arrays) -> Float[np.ndarray, " push"]:
    """Return the direction of the pusher's path (rad)."""
    start = arrays["initial_pusher"]
    last = arrays["command_position"][np.arange(len(start)), arrays["steps"] - 1]
    return np.arctan2(*(last - start).T[::-1])


def _side(arrays: Arrays) -> Float[np.ndarray, " push"]:
    """Return where on its circumference the disk is pushed (rad)."""
    disk = pushed_disk(arrays)
    normal = disk[:, :2] - arrays["initial_pusher"]
    return np.arctan2(normal[:, 1], normal[:, 0]) - disk[:, 2]


def _blocks(values: Float[np.ndarray, " push"], count: int) -> Int[np.ndarray, " push"]:
    """Return the fold of each push: neighbours share one, equal values always do."""
    values = np.round(values, _DIGITS)
    _, number, sizes = np.unique(values, return_inverse=True, return_counts=True)
    middle = np.cumsum(sizes) - 1 - sizes // 2  # rank of the middle of equal values
    return middle[number] * count // len(values)
