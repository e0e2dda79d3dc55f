"""Bystanders: untouched disks added to stored pushes.

In two-disk pushes the disks touch: a network trained only on such pushes predicts an
effect even between disks that do not interact. The ground truth of a bystander needs
neither simulation nor recording, because it stays at rest and affects nothing. A
bystander can be added to any push with known paths, at any position that these paths
never reach, also next to another disk. Only the simulator prediction is computed again:
with assumed radii the disks may overlap.
"""

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float
from msgspec import structs

from sainet.datasets.batch import simulate
from sainet.datasets.schema import Arrays, StoreInfo, simulated_name, variables
from sainet.datasets.store import Store
from sainet.datasets.writer import derive
from sainet.engines.simulator import stored_simulator
from sainet.runs.errors import BadStore
from sainet.scenes.quantities import MOST_DISKS

TOUCHING = 0.5  # fraction of the attempts that touch another disk
FARTHEST = 0.02  # m, largest gap to the nearest disk
_TOUCH = 1e-5  # m, gap of touching disks: rounding never makes it an overlap
_BESIDE_PUSHER = 5e-4  # m: the pushed disk is nearer to the pusher by at least this
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
    """Return a dataset of the same pushes, each with a bystander; written once.

    Args:
        store: read whole into memory.
        out: the run folder.
        seed: of the bystanders' masses, radii and positions.
        on_pushes: called with the number of newly predicted pushes.

    Raises:
        BadStore: the path of a disk is unknown at some step, or no engine of the
            dataset can have one disk more.
        RunConflict: the folder belongs to another run.
        MissingExtra: an internal engine needs a package that is not installed.
    """
    rng = np.random.default_rng([_STREAM, seed])
    _check_possible(store)  # before the folder exists

    def change(arrays: Arrays) -> Arrays:
        return with_bystander(arrays, store.info, rng, on_pushes)

    return derive(store, out, {"bystander_seed": seed}, change)


def _check_possible(store: Store) -> None:
    specs = map(stored_simulator, store.info.assumed_engines)
    most = min([MOST_DISKS, *(spec.build().most_disks for spec in specs)])
    if store.info.bodies >= most:
        raise BadStore(f"{store.path}: has {most} disks, the most; give one of fewer.")
    arrays = store.read(slice(None), ("truth", "truth_pusher", "steps"))
    known = np.isfinite(arrays["truth"]).all((2, 3))
    known &= np.isfinite(arrays["truth_pusher"]).all(2)
    if not (known | ~_lasts(arrays)).all():
        raise BadStore(
            f"{store.path}: truth is unknown at some steps, so no position is certain "
            "to stay untouched; give pushes with known paths."
        )


def _lasts(arrays: Arrays) -> Bool[np.ndarray, "push time"]:
    """Return whether each step belongs to its push or follows its end."""
    return np.arange(arrays["truth"].shape[1]) < arrays["steps"][:, None]


def with_bystander(
    arrays: Arrays,
    info: StoreInfo,
    rng: np.random.Generator,
    on_pushes: Callable[[int], None] = lambda pushes: None,
) -> Arrays:
    """Return every array of a store with a bystander as the last disk of each push.

    Its mass and radius are uniform within the range of the store. Its measured poses
    have no noise, and its published predictions are NaN.
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
    for name, variable in variables(structs.replace(info, assumed_engines=())).items():
        array = arrays[name]
        if "body" in variable.dimensions:
            array = _append(array, known.get(name), variable.dimensions.index("body"))
        found[name] = array
    wider = structs.replace(info, pushes=pushes, bodies=info.bodies + 1)
    for engine in info.assumed_engines:
        found[simulated_name(engine)] = _simulate(engine, found, wider, on_pushes)
    return found


def _append(array: np.ndarray, values: np.ndarray | None, axis: int) -> np.ndarray:
    """Return an array with one more entry along an axis; NaN if it has no values."""
    shape = (*array.shape[:axis], 1, *array.shape[axis + 1 :])
    one = np.broadcast_to(np.nan if values is None else values, shape)
    return np.concatenate([array, one.astype(array.dtype)], axis=axis)


def _simulate(
    engine: str, arrays: Arrays, info: StoreInfo, on_pushes: Callable[[int], None]
) -> np.ndarray:
    parts, simulator = [], stored_simulator(engine)
    for index in range(info.chunks):
        rows = info.chunk_slice(index)
        chunk = {name: array[rows] for name, array in arrays.items()}
        parts.append(simulate(simulator, chunk, info, info.push_names(rows)))
        on_pushes(info.chunk_length(index))
    return np.concatenate(parts)


class _Round(NamedTuple):
    """A disk or the pusher: its path in each push, the start included."""

    path: Float[np.ndarray, "push time 2"]
    radius: Float[np.ndarray, " push"]

    def of(self, rows: np.ndarray) -> "_Round":
        return _Round(self.path[rows], self.radius[rows])

    def gaps(
        self, place: Float[np.ndarray, "push 2"], radius: Float[np.ndarray, " push"]
    ) -> Float[np.ndarray, "push time"]:
        """Return the gaps to a disk at rest (m); negative for an overlap."""
        apart = np.linalg.norm(self.path - place[:, None], axis=-1)
        return apart - self.radius[:, None] - radius[:, None]


def _place(
    arrays: Arrays, radius: Float[np.ndarray, " push"], rng: np.random.Generator
) -> Float[np.ndarray, "push 2"]:
    """Return positions of untouched bystanders (m), next to another disk if possible.

    A bystander without such a position is far away from all disks.
    """
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
        direction = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
        tried = start + reach[:, None] * direction
        others = [disk.of(left) for disk in disks]
        free = _is_free(tried, radius[left], others, pusher.of(left))
        place[left[free]] = tried[free]
        left = left[~free]
    return place


def _round_things(arrays: Arrays) -> list[_Round]:
    """Return the disks, then the pusher."""
    initial, truth = arrays["initial"][:, None, :, :2], arrays["truth"][..., :2]
    tip = arrays["initial_pusher"][:, None]
    # Steps after the end of a push repeat the start.
    truth = np.where(_lasts(arrays)[..., None, None], truth, initial)
    pusher = np.where(_lasts(arrays)[..., None], arrays["truth_pusher"], tip)
    paths = np.concatenate([initial, truth], axis=1, dtype=float)
    disks = [
        _Round(paths[:, :, body], arrays["radius"][:, body])
        for body in range(paths.shape[2])
    ]
    path = np.concatenate([tip, pusher], axis=1, dtype=float)
    return [*disks, _Round(path, arrays["pusher_radius"])]


def _is_free(
    place: Float[np.ndarray, "push 2"],
    radius: Float[np.ndarray, " push"],
    disks: list[_Round],
    pusher: _Round,
) -> Bool[np.ndarray, " push"]:
    """Return whether nothing reaches the position and it is not nearest to the pusher.

    The disk nearest to the pusher at the start counts as the pushed disk.
    """
    gaps = [thing.gaps(place, radius).min(1) for thing in (*disks, pusher)]
    tip = pusher.path[:, 0]
    pushed = np.min([d.gaps(tip, pusher.radius)[:, 0] for d in disks], axis=0)
    nearest = pusher.gaps(place, radius)[:, 0]
    return (np.min(gaps, axis=0) >= 0) & (nearest > pushed + _BESIDE_PUSHER)
