"""Cross-validation: folds that repeats never straddle, and their errors as one."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Int

from sainet.datasets.store import Store
from sainet.evaluation.evaluate import Evaluation
from sainet.evaluation.metrics import PushErrors

_STREAM = 0xF01D


@dataclass(frozen=True)
class Fold:
    """A part of the pushes that is tested on, and the rest that is trained on."""

    number: int
    training: Store
    tests: Store
    rows: Int[np.ndarray, " test"]  # of the tests, in the whole store


def make_folds(store: Store, count: int, seed: int = 0) -> list[Fold]:
    """Divide a store into folds of nearly one size; repeats stay together."""
    owner = fold_of_push(store.repeats(), count, seed)
    return [
        Fold(
            number,
            training=store.take(np.flatnonzero(owner != number)),
            tests=store.take(np.flatnonzero(owner == number)),
            rows=np.flatnonzero(owner == number),
        )
        for number in range(count)
    ]


def fold_of_push(
    repeats: Int[np.ndarray, " push"], count: int, seed: int
) -> Int[np.ndarray, " push"]:
    """Return the fold of each push, drawn at random: the same for repeats."""
    kinds, kind = np.unique(repeats, return_inverse=True)
    order = np.random.default_rng([_STREAM, seed]).permutation(len(kinds))
    return order[kind] % count


def join_folds(parts: Sequence[tuple[Fold, Evaluation]]) -> Evaluation:
    """Return the evaluation of all pushes, each by what was not trained on it.

    Args:
        parts: of every fold of a store, with the same models in each.
    """
    rows = np.concatenate([fold.rows for fold, _ in parts])
    order = np.argsort(rows)

    def whole(errors: Sequence[PushErrors]) -> PushErrors:
        names = vars(errors[0])
        return PushErrors(
            **{
                name: np.concatenate([vars(each)[name] for each in errors])[order]
                for name in names
            }
        )

    found = [evaluation for _, evaluation in parts]
    first = found[0]
    groups = [group for each in found for group in each.groups]
    owners = np.concatenate([np.full(len(fold.rows), fold.number) for fold, _ in parts])
    return replace(
        first,
        errors={name: whole([e.errors[name] for e in found]) for name in first.errors},
        published={
            name: whole([each.published[name] for each in found])
            for name in first.published
        },
        travel_mm=np.concatenate([each.travel_mm for each in found])[order],
        groups=tuple(groups[place] for place in order),
        folds=tuple(owners[order].tolist()),
    )
