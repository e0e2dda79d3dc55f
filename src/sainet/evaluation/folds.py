"""Errors of all folds of a cross-validation, joined."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from sainet.datasets.splits import Fold
from sainet.evaluation.evaluate import Evaluation
from sainet.evaluation.metrics import PushErrors


def join_folds(parts: Sequence[tuple[Fold, Evaluation]]) -> Evaluation:
    """Return the evaluation of all pushes, each by models not trained on it.

    Args:
        parts: of every fold, with the same models in each; together their tests are
            all pushes of interest, each once.
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
