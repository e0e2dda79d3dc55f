"""Which pushes are kept for validation."""

import numpy as np
from jaxtyping import Int

_STREAM = 0x5B117


def split(
    repeats: Int[np.ndarray, " push"], share: float, seed: int
) -> tuple[Int[np.ndarray, " trained"], Int[np.ndarray, " validated"]]:
    """Return the pushes to train on and those to validate on, drawn at random.

    Repeats stay together: what a network has seen a repeat of tells nothing new. At
    least one push is on either side, unless all are repeats of one or share is zero.

    Args:
        repeats: a number for each push, the same for those that are alike.
        share: of the pushes that are validated on, met as nearly as repeats allow.
        seed: of the draw.
    """
    rng = np.random.default_rng([_STREAM, seed])
    kinds, kind = np.unique(repeats, return_inverse=True)
    order = np.argsort(rng.permutation(len(kinds))[kind], kind="stable")
    between = 1 + np.flatnonzero(np.diff(kind[order]))
    if not share or not len(between):
        return np.arange(len(repeats)), order[:0]
    kept = between[np.argmin(np.abs(between - share * len(repeats)))]
    return order[kept:], order[:kept]
