"""Facts of stored pushes that inspection counts, draws and doubts."""

from dataclasses import dataclass, fields

import numpy as np
from jaxtyping import Float, Int

from sainet.datasets.schema import Arrays, StoreInfo
from sainet.datasets.store import Store, last_known
from sainet.scenes.geometry import wrap_angle
from sainet.scenes.quantities import PROPERTIES

PATH_POINTS = 9  # of the pusher's path
_NAMES = ("steps", "group", "initial", "initial_pusher", "truth", "truth_pusher")
_PART = 250  # pushes read at a time, at most


@dataclass(frozen=True)
class Facts:
    """Facts of pushes; lengths in m, angles in rad, NaN where no pose is known."""

    steps: Int[np.ndarray, " push"]
    group: Int[np.ndarray, " push"]
    known_steps: Int[np.ndarray, " push"]  # with a known pose
    duration: Float[np.ndarray, " push"]  # s, of the pusher's motion
    start: Float[np.ndarray, "push body 3"]
    end: Float[np.ndarray, "push body 3"]  # last known pose
    path: Float[np.ndarray, "push point 2"]  # of the pusher, thinned out
    stroke: Float[np.ndarray, " push"]  # farthest distance from its start
    path_length: Float[np.ndarray, " push"]
    top_speed: Float[np.ndarray, " push"]  # m/s
    unseen: Float[np.ndarray, " push"]  # path length after the last known pose
    contact_angle: Float[np.ndarray, " push"]  # see `scenes.pushes.Push`
    direction: Float[np.ndarray, " push"]
    moved: Float[np.ndarray, "push body"]  # farthest distance from the start
    turned: Float[np.ndarray, "push body"]  # largest rotation from the start
    gap: Float[np.ndarray, "push body"]  # least, of the path and the disk at its start
    start_overlap: Float[np.ndarray, " push"]  # deepest, of any two bodies
    overlap: Float[np.ndarray, " push"]  # deepest after the start
    mass: Float[np.ndarray, "push body"]  # kg
    radius: Float[np.ndarray, "push body"]
    pusher_radius: Float[np.ndarray, " push"]
    table_friction: Float[np.ndarray, " push"]
    disk_friction: Float[np.ndarray, " push"]
    pusher_friction: Float[np.ndarray, " push"]


def facts_of(store: Store) -> Facts:
    """Return the facts of all pushes of a store; it is read in parts.

    Raises:
        BadStore: the store is damaged.
    """
    info, size = store.info, min(store.info.chunk_size, _PART)
    names = (*_NAMES, "pose_observed", *PROPERTIES)
    parts = [
        _facts(store.read(slice(first, first + size), names), info)
        for first in range(0, info.pushes, size)
    ]
    columns = {
        each.name: np.concatenate([getattr(part, each.name) for part in parts])
        for each in fields(Facts)
    }
    return Facts(**columns)


def _facts(arrays: Arrays, info: StoreInfo) -> Facts:
    steps, radius = arrays["steps"], arrays["radius"].astype(float)
    exists = np.arange(info.steps) < steps[:, None]
    known = (arrays["pose_observed"] > 0) & exists
    start = arrays["initial"][..., :3].astype(float)
    pose = np.where(known[..., None, None], arrays["truth"][..., :3], np.nan)
    pose = np.concatenate([start[:, None], pose], axis=1)
    last = np.minimum(np.arange(info.steps + 1), steps[:, None])
    first = arrays["initial_pusher"][:, None].astype(float)
    pusher = np.concatenate([first, arrays["truth_pusher"]], axis=1)
    pusher = np.take_along_axis(pusher, last[..., None], axis=1)
    reach = np.concatenate([radius, arrays["pusher_radius"][:, None]], axis=1)
    away = pose[:, 1:] - pose[:, :1]
    properties = {name: arrays[name].astype(float) for name in PROPERTIES}
    return Facts(
        steps=steps,
        group=arrays["group"],
        known_steps=known.sum(axis=1),
        start=start,
        end=last_known(pose[:, 1:], known),
        moved=np.fmax.reduce(np.hypot(away[..., 0], away[..., 1]), axis=1),
        turned=np.fmax.reduce(np.abs(away[..., 2]), axis=1),
        gap=_gap(pusher, start, reach),
        start_overlap=_overlap(pose[:, :1], pusher[:, :1], reach),
        overlap=_overlap(pose[:, 1:], pusher[:, 1:], reach),
        **_of_pusher(pusher, known, info.time_step),
        **_of_contact(start, pusher, pushed_disk(arrays)),
        **properties,
    )


def _of_pusher(
    pusher: Float[np.ndarray, "push time 2"], known: np.ndarray, time_step: float
) -> Arrays:
    far = np.linalg.norm(pusher - pusher[:, :1], axis=-1)
    moves = np.linalg.norm(np.diff(pusher, axis=1), axis=-1)
    stroke = far.max(axis=1)
    # The pusher may wait before and after its stroke.
    reached, step = np.maximum.accumulate(far, axis=1), np.arange(far.shape[1])
    times = [np.interp(np.array((0.01, 0.99)) * r[-1], r, step) for r in reached]
    points = np.linspace(0, pusher.shape[1] - 1, PATH_POINTS).astype(int)
    seen = np.flip(np.maximum.accumulate(np.flip(known, axis=1), axis=1), axis=1)
    return {
        "path": pusher[:, points],
        "stroke": stroke,
        "path_length": moves.sum(axis=1),
        "top_speed": moves.max(axis=1) / time_step,
        "duration": time_step * np.maximum(np.diff(times)[:, 0] / 0.98, 1),
        "unseen": np.where(seen, 0.0, moves).sum(axis=1),
    }


def _of_contact(
    start: Float[np.ndarray, "push body 3"],
    pusher: Float[np.ndarray, "push time 2"],
    pushed: Float[np.ndarray, "push 6"],
) -> Arrays:
    """Return contact angle and direction, from the disk nearest to the pusher."""
    normal = _angle(pushed[:, :2] - pusher[:, 0])
    axis = np.zeros(len(start))
    if start.shape[1] > 1:
        axis = _angle(start[:, 1, :2] - start[:, 0, :2])
    far = np.linalg.norm(pusher - pusher[:, :1], axis=-1).argmax(axis=1)
    heading = _angle(pusher[np.arange(len(start)), far] - pusher[:, 0])
    return {
        "contact_angle": wrap_angle(normal - axis),
        "direction": wrap_angle(heading - normal),
    }


def pushed_disk(arrays: Arrays) -> Float[np.ndarray, "push 6"]:
    """Return the motion before the push of the disk nearest to the pusher."""
    start = arrays["initial"]
    inward = start[..., :2].astype(float) - arrays["initial_pusher"][:, None]
    nearest = np.argmin(np.linalg.norm(inward, axis=-1) - arrays["radius"], axis=1)
    return start[np.arange(len(start)), nearest]


def _gap(
    pusher: Float[np.ndarray, "push time 2"],
    start: Float[np.ndarray, "push body 3"],
    reach: Float[np.ndarray, "push bodies"],
) -> Float[np.ndarray, "push body"]:
    """Return the least distance of the path from each disk at its start.

    The first contact is with a disk that has not moved yet. Between two samples the
    pusher moves along a line.
    """
    ones, steps = pusher[:, :-1, None], np.diff(pusher, axis=1)[:, :, None]
    towards = start[:, None, :, :2] - ones
    squared = np.maximum((steps**2).sum(axis=-1), 1e-18)
    share = np.clip((towards * steps).sum(axis=-1) / squared, 0, 1)
    apart = np.linalg.norm(towards - share[..., None] * steps, axis=-1)
    return (apart - reach[:, None, :-1] - reach[:, None, -1:]).min(axis=1)


def _overlap(
    pose: Float[np.ndarray, "push time body 3"],
    pusher: Float[np.ndarray, "push time 2"],
    reach: Float[np.ndarray, "push bodies"],
) -> Float[np.ndarray, " push"]:
    """Return how deep any two bodies overlap at any time; negative if they do not."""
    places = np.concatenate([pose[..., :2], pusher[:, :, None]], axis=2)
    deepest = np.full(len(pose), np.nan)
    for one in range(places.shape[2]):
        for other in range(one):
            apart = np.linalg.norm(places[:, :, one] - places[:, :, other], axis=-1)
            depth = (reach[:, one] + reach[:, other])[:, None] - apart
            deepest = np.fmax(deepest, np.fmax.reduce(depth, axis=1))
    return deepest


def _angle(vector: Float[np.ndarray, "push 2"]) -> Float[np.ndarray, " push"]:
    return np.arctan2(vector[:, 1], vector[:, 0])
