"""Chains: pushes of which each starts where another one ended.

A model that takes the place on the table may interpolate along chains.
"""

import numpy as np
from jaxtyping import Float, Int

from sainet.datasets.store import Store, last_known
from sainet.scenes.geometry import wrap_angle

_SAME_PLACE = 3e-4  # m
_SAME_ANGLE = np.deg2rad(1.0)  # rad


def linked(store: Store) -> Int[np.ndarray, " push"]:
    """Return a number for each push: repeats and pushes of one chain share it."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    arrays = store.read(slice(None), ("initial", "truth", "pose_observed"))
    after = last_known(arrays["truth"][..., :3], arrays["pose_observed"] > 0)
    count = store.info.pushes
    _, first = np.unique(store.repeats(), return_inverse=True)
    ended, started = continuations(arrays["initial"][..., :3], after)
    # A node for each push and for each set of repeats.
    edges = np.append(np.arange(count), ended), np.append(count + first, started)
    graph = coo_array((np.ones(len(edges[0])), edges), shape=(2 * count, 2 * count))
    return connected_components(graph, directed=False)[1][:count]


def continuations(
    start: Float[np.ndarray, "push body 3"], end: Float[np.ndarray, "push body 3"]
) -> tuple[Int[np.ndarray, " pair"], Int[np.ndarray, " pair"]]:
    """Return all pairs of pushes of which the second starts where the first ended.

    All disks are within 0.3 mm and one degree. A push that ends where it started is
    paired with itself.

    Args:
        start: poses (m, m, rad).
        end: poses; NaN where they are not known.
    """
    from scipy.spatial import KDTree

    known = np.flatnonzero(np.isfinite(end).all(axis=(1, 2)))
    trees = KDTree(_places(end[known])), KDTree(_places(start))
    near = trees[0].query_ball_tree(trees[1], _SAME_PLACE, p=np.inf)
    ended = np.repeat(known, [len(each) for each in near])
    started = np.concatenate([known[:0], *near]).astype(int)
    apart = start[started] - end[ended]
    far = np.hypot(apart[..., 0], apart[..., 1])
    turned = np.abs(wrap_angle(apart[..., 2]))
    same = ((far <= _SAME_PLACE) & (turned <= _SAME_ANGLE)).all(axis=1)
    return ended[same], started[same]


def _places(pose: Float[np.ndarray, "push body 3"]) -> Float[np.ndarray, "push column"]:
    """Return points of which all coordinates are near each other if the poses are."""
    rim = _SAME_PLACE / _SAME_ANGLE * np.exp(1j * pose[..., 2])
    columns = [pose[..., 0], pose[..., 1], rim.real, rim.imag]
    return np.concatenate(columns, axis=1)
