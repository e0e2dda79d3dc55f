"""Measurements of all folds of a cross-validation, joined."""

from collections.abc import Sequence

import numpy as np

from sainet.datasets.splits import Fold
from sainet.evaluation.joining import join
from sainet.evaluation.measurements import Measurements


def join_folds(parts: Sequence[tuple[Fold, Measurements]]) -> Measurements:
    """Return the measurements of all pushes, each by models not trained on it.

    Args:
        parts: of every fold, with the same models in each; together their tests are
            all pushes of interest, each once.
    """
    order = np.argsort(np.concatenate([fold.rows for fold, _ in parts]))
    owner = [np.full(len(fold.rows), fold.number) for fold, _ in parts]
    rows = np.concatenate([fold.rows for fold, _ in parts])
    whole = join([measured for _, measured in parts])
    places = {"fold": np.concatenate(owner), "row": rows}
    data = whole.data.assign_coords(
        {k: ("sample", v.astype(np.int32)) for k, v in places.items()}
    )
    return Measurements(data.isel(sample=order), whole.header)
