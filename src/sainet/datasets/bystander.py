"""Pushes with one disk more, which nothing touches: it stays, and nothing else changes.

In two-disk pushes the disks touch: a network that trains on these alone never sees a
disk that does not act, and what it says of one is no zero. Nobody has to simulate or to
record a bystander to know the truth about it. It can be added to any push whose paths
are known, and lies wherever those leave it alone, also right beside another disk. Only
the assumed engine has to be asked again: it may believe that the disks overlap.
"""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from sainet.datasets.derive import derive
from sainet.datasets.predictions import simulate
from sainet.datasets.schema import Arrays, StoreInfo, simulated_name, variables
from sainet.datasets.store import Store
from sainet.engines.simulator import simulator_named
from sainet.runs.errors import BadStore

TOUCHING = 0.5  # share of the tries that are in touch with another disk
FARTHEST = 0.02  # m, the widest gap to the disk beside which one lies
_TOUCH = 1e-5  # m, a gap that no rounding makes an overlap
_BESIDE_PUSHER = 5e-4  # m, by which the pushed disk is nearer to the pusher
_TRIES = 64
_NOWHERE_NEAR = 1.0  # m
_STREAM = 0xB157A


def add_bystander(
    store: Store,
    out: Path,
    *,
    seed: int = 0,
    on_pushes: Callable[[int], None] = lambda pushes: None,
) -> Store:
    """Write a dataset of the same pushes, each with a bystander, once.

    Args:
        store: read whole into memory.
        out: the run folder.
        seed: of the bystanders' masses, radii and places.
        on_pushes: told how many pushes an assumed engine has just predicted.

    Raises:
        BadStore: the paths of its disks are not known all the way.
        RunConflict: the folder holds something else.
        MissingExtra: an assumed engine needs a package that is not installed.
    """
    rng = np.random.default_rng([_STREAM, seed])

    def change(arrays: Arrays) -> Arrays:
        _check_paths(store, arrays)
        return with_bystander(arrays, store.info, rng, on_pushes)

    return derive(store, out, {"bystander_seed": seed}, change)


def _check_paths(store: Store, arrays: Arrays) -> None:
    known = np.isfinite(arrays["truth"]).all((2, 3))
    known &= np.isfinite(arrays["truth_pusher"]).all(2)
    if not (known | ~_lasts(arrays)).all():
        raise BadStore(
            f"{store.path}: truth is not known at every step, so nobody can say where "
            "a bystander would lie untouched; give pushes whose paths are known."
        )


def _lasts(arrays: Arrays) -> Bool[np.ndarray, "push time"]:
    """Return which steps belong to each push."""
    return np.arange(arrays["truth"].shape[1]) < arrays["steps"][:, None]


def with_bystander(
    arrays: Arrays,
    info: StoreInfo,
    rng: np.random.Generator,
    on_pushes: Callable[[int], None] = lambda pushes: None,
) -> Arrays:
    """Return every array of a store with one disk more in each push, the last one.

    Its mass and radius are drawn uniformly from the range that the store has. It is
    captured without noise. Of published predictions it has none (NaN).
    """
    pushes = len(arrays["mass"])
    still = {
        name: rng.uniform(arrays[name].min(), arrays[name].max(), pushes)
        for name in ("mass", "radius")
    }
    place = _place(arrays, still["radius"], rng)
    rest = np.concatenate([place, np.zeros((pushes, 4))], axis=-1)
    known = {
        **{name: values[:, None] for name, values in still.items()},
        "initial": rest[:, None],
        "truth": rest[:, None, None],
        "measured": rest[:, None, None, :3],
    }
    found = {}
    for name, variable in variables(replace(info, assumed_engines=())).items():
        array = arrays[name]
        if "body" in variable.dimensions:
            array = _append(array, known.get(name), variable.dimensions.index("body"))
        found[name] = array
    wider = replace(info, pushes=pushes, bodies=info.bodies + 1)
    for engine in info.assumed_engines:
        found[simulated_name(engine)] = _simulate(engine, found, wider, on_pushes)
    return found


def _append(array: np.ndarray, values: np.ndarray | None, axis: int) -> np.ndarray:
    """Return an array with one more along an axis; NaN where nothing is known of it."""
    shape = (*array.shape[:axis], 1, *array.shape[axis + 1 :])
    one = np.broadcast_to(np.nan if values is None else values, shape)
    return np.concatenate([array, one.astype(array.dtype)], axis=axis)


def _simulate(
    engine: str, arrays: Arrays, info: StoreInfo, on_pushes: Callable[[int], None]
) -> np.ndarray:
    parts, simulator = [], simulator_named(engine)
    for index in range(info.chunks):
        rows = info.chunk_slice(index)
        names = [f"push {row} of the dataset" for row in range(rows.start, rows.stop)]
        chunk = {name: array[rows] for name, array in arrays.items()}
        parts.append(simulate(simulator, chunk, info, names))
        on_pushes(len(names))
    return np.concatenate(parts)


class _Round(NamedTuple):
    """A round thing in each push: where it is, at the start and after each step."""

    path: Float[np.ndarray, "push time 2"]
    radius: Float[np.ndarray, " push"]

    def of(self, rows: np.ndarray) -> "_Round":
        return _Round(self.path[rows], self.radius[rows])

    def gaps(
        self, place: Float[np.ndarray, "push 2"], radius: Float[np.ndarray, " push"]
    ) -> Float[np.ndarray, "push time"]:
        """Return the gaps to a disk that stays (m); negative: overlap."""
        apart = np.linalg.norm(self.path - place[:, None], axis=-1)
        return apart - self.radius[:, None] - radius[:, None]


def _place(
    arrays: Arrays, radius: Float[np.ndarray, " push"], rng: np.random.Generator
) -> Float[np.ndarray, "push 2"]:
    """Return where nothing touches such a disk, beside another one if possible."""
    *disks, pusher = _round_things(arrays)
    place = disks[0].path[:, 0] + _NOWHERE_NEAR
    left = np.arange(len(radius))
    for _ in range(_TRIES):
        beside = rng.integers(0, len(disks), len(left))
        angle = rng.uniform(-np.pi, np.pi, len(left))
        gap = rng.uniform(_TOUCH, FARTHEST, len(left))
        gap = np.where(rng.random(len(left)) < TOUCHING, _TOUCH, gap)
        start = arrays["initial"][left, beside, :2]
        reach = arrays["radius"][left, beside] + radius[left] + gap
        way = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
        tried = start + reach[:, None] * way
        those = [disk.of(left) for disk in disks]
        free = _is_free(tried, radius[left], those, pusher.of(left))
        place[left[free]] = tried[free]
        left = left[~free]
    return place


def _round_things(arrays: Arrays) -> list[_Round]:
    """Return the disks, and the pusher as the last."""
    initial, truth = arrays["initial"][:, None, :, :2], arrays["truth"][..., :2]
    hand = arrays["initial_pusher"][:, None]
    # What follows the end of a push never happened: the start stands in for it.
    truth = np.where(_lasts(arrays)[..., None, None], truth, initial)
    pusher = np.where(_lasts(arrays)[..., None], arrays["truth_pusher"], hand)
    paths = np.concatenate([initial, truth], axis=1, dtype=float)
    disks = [
        _Round(paths[:, :, body], arrays["radius"][:, body])
        for body in range(paths.shape[2])
    ]
    path = np.concatenate([hand, pusher], axis=1, dtype=float)
    return [*disks, _Round(path, arrays["pusher_radius"])]


def _is_free(
    place: Float[np.ndarray, "push 2"],
    radius: Float[np.ndarray, " push"],
    disks: list[_Round],
    pusher: _Round,
) -> Bool[np.ndarray, " push"]:
    """Return whether all pass by, and the pusher starts nearest to another disk.

    For which disk is pushed is told by which is nearest to the pusher at the start.
    """
    gaps = [thing.gaps(place, radius).min(1) for thing in (*disks, pusher)]
    hand = pusher.path[:, 0]
    pushed = np.min([d.gaps(hand, pusher.radius)[:, 0] for d in disks], axis=0)
    nearest = pusher.gaps(place, radius)[:, 0]
    return (np.min(gaps, axis=0) >= 0) & (nearest > pushed + _BESIDE_PUSHER)
