"""Train and test parts of a dataset, and folds for cross-validation.

Repeats stay together: a model trained on one repeat was, in effect, trained on all.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Int

from sainet.datasets.chains import linked
from sainet.datasets.store import Store
from sainet.datasets.writer import write_once
from sainet.runs.errors import BadInput, RunConflict, require
from sainet.runs.manifest import MANIFEST
from sainet.scenes.quantities import require_seed

_SPLIT_STREAM, _FOLD_STREAM = 0x5B117, 0xF01D


@dataclass(frozen=True)
class Fold:
    """Test pushes, and the pushes that models of this fold may be trained on."""

    number: int
    training: Store
    tests: Store
    rows: Int[np.ndarray, " test"]  # of the tests, in the whole store


def split(
    store: Store, test: float = 0.2, seed: int = 0, *, chains: bool = False
) -> tuple[Store, Store]:
    """Return the training pushes and the test pushes, drawn at random.

    Args:
        store: at least two pushes that are not repeats of each other.
        test: share of the test pushes, met as nearly as repeats allow.
        seed: of the draw.
        chains: keep recorded chains together as well (see `datasets.chains`).

    Raises:
        BadInput: all pushes belong together, so that one part would be empty.
    """
    kinds = linked(store) if chains else store.repeats()
    trained, tested = split_rows(kinds, test, seed)
    if not len(tested):
        together = "repeats or one chain" if chains else "repeats"
        raise BadInput(
            f"{store.path}: all pushes are {together}, which stay together; "
            "record other pushes."
        )
    return store.take(np.sort(trained)), store.take(np.sort(tested))


def split_rows(
    kinds: Int[np.ndarray, " push"], share: float, seed: int
) -> tuple[Int[np.ndarray, " one"], Int[np.ndarray, " other"]]:
    """Return the rows of the larger and of the smaller part, drawn at random.

    At least one push is in either part, unless all are of one kind or share is zero.

    Args:
        kinds: equal numbers for pushes that stay together.
        share: of the second part, met as nearly as the kinds allow.
        seed: of the draw.
    """
    rng = np.random.default_rng([_SPLIT_STREAM, seed])
    found, kind = np.unique(kinds, return_inverse=True)
    order = np.argsort(rng.permutation(len(found))[kind], kind="stable")
    between = 1 + np.flatnonzero(np.diff(kind[order]))
    if not share or not len(between):
        return np.arange(len(kinds)), order[:0]
    kept = between[np.argmin(np.abs(between - share * len(kinds)))]
    return order[kept:], order[:kept]


def make_folds(
    store: Store, count: int, part: Int[np.ndarray, " some"] | None = None
) -> list[Fold]:
    """Divide a store into folds of nearly equal size; repeats stay together.

    Args:
        store: of all pushes.
        count: of the folds.
        part: rows to use only, for tests and training; a push is in the same fold
            whatever the part.
    """
    rows = np.arange(store.info.pushes) if part is None else part
    return folds_of(store, rows, fold_of_push(store.repeats(), count)[rows], count)


def folds_of(
    store: Store,
    rows: Int[np.ndarray, " some"],
    owner: Int[np.ndarray, " some"],
    count: int,
) -> list[Fold]:
    """Divide some pushes of a store into given folds.

    Args:
        store: of all pushes.
        rows: to use only, for tests and training.
        owner: fold of each of them, from 0.
        count: of the folds.
    """
    return [
        Fold(
            number,
            training=store.take(rows[owner != number]),
            tests=store.take(rows[owner == number]),
            rows=rows[owner == number],
        )
        for number in range(count)
    ]


def fold_of_push(
    kinds: Int[np.ndarray, " push"], count: int, seed: int = 0
) -> Int[np.ndarray, " push"]:
    """Return the fold of each push, drawn at random: equal for pushes of one kind."""
    found, kind = np.unique(kinds, return_inverse=True)
    order = np.random.default_rng([_FOLD_STREAM, seed]).permutation(len(found))
    return order[kind] % count


def write_split(
    store: Store, out: Path, *, test: float = 0.2, seed: int = 0, chains: bool = False
) -> tuple[Store, Store]:
    """Write the training and the test part as datasets, once.

    Args:
        store: to divide.
        out: folder of the two run folders, `train` and `test`; interrupted ones resume.
        test: share of the test pushes, above 0 and below 1.
        seed: of the draw, 0 or more.
        chains: keep recorded chains together as well (see `datasets.chains`).

    Raises:
        BadSetting: a setting is out of its range.
        BadInput: one part would be empty, or the disk is full.
        RunConflict: a folder holds something else.
    """
    require(0 < test < 1, "test", "above 0 and below 1", test)
    require_seed(seed)
    parts = split(store, test, seed, chains=chains)
    settings = {"command": "split", "data": store.content, "test": float(test)}
    settings |= {"seed": int(seed), "chains": chains}
    if (Path(out) / MANIFEST).exists():
        raise RunConflict(f"{out}: holds another run; choose another `out`.")
    train, tests = (
        write_once(
            Path(out) / name,
            settings | {"part": name},
            part.info,
            lambda index, part=part: part.read(part.info.chunk_slice(index)),
        )
        for name, part in zip(("train", "test"), parts, strict=True)
    )
    return train, tests
