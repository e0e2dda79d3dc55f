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
    """Pushes that are tested on, and what may be trained on before."""

    number: int
    training: Store
    tests: Store
    rows: Int[np.ndarray, " test"]  # of the tests, in the whole store


def make_folds(
    store: Store,
    count: int,
    part: Int[np.ndarray, " some"] | None = None,
) -> list[Fold]:
    """Divide a store into folds of nearly one size; repeats stay together.

    Args:
        store: of all pushes.
        count: of the folds.
        part: the pushes to take alone, tested and trained on; they are in the same
            fold whatever part is taken.
    """
    rows = np.arange(store.info.pushes) if part is None else part
    owner = fold_of_push(store.repeats(), count)[rows]
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
    repeats: Int[np.ndarray, " push"], count: int, seed: int = 0
) -> Int[np.ndarray, " push"]:
    """Return the fold of each push, drawn at random: the same for repeats."""
    kinds, kind = np.unique(repeats, return_inverse=True)
    order = np.random.default_rng([_STREAM, seed]).permutation(len(kinds))
    return order[kind] % count


def join_folds(parts: Sequence[tuple[Fold, Evaluation]]) -> Evaluation:
    """Return the evaluation of all pushes, each by what was not trained on it.

    Args:
        parts: of every fold, with the same models in each; together their tests are
            all pushes that are looked at, each once.
    """
    order = np.argsort(np.concatenate([fold.rows for fold, _ in parts]))
    owner = np.concatenate([np.full(len(fold.rows), fold.number) for fold, _ in parts])
    found = [evaluation for _, evaluation in parts]
    groups = [group for each in found for group in each.groups]
    return replace(
        found[0],
        errors=_joined([each.errors for each in found], order),
        published=_joined([each.published for each in found], order),
        travel_mm=np.concatenate([each.travel_mm for each in found])[order],
        groups=tuple(groups[place] for place in order),
        folds=tuple(owner[order].tolist()),
    )


def _joined(
    parts: Sequence[dict[str, PushErrors]], order: np.ndarray
) -> dict[str, PushErrors]:
    def whole(name: str, metric: str) -> np.ndarray:
        return np.concatenate([vars(part[name])[metric] for part in parts])[order]

    return {
        name: PushErrors(**{metric: whole(name, metric) for metric in vars(errors)})
        for name, errors in parts[0].items()
    }
