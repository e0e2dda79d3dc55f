"""Recorded pushes as the arrays of a store: what is known, and s-bar beside it."""

import numpy as np
from jaxtyping import Float

from sainet.datasets.predictions import simulate
from sainet.datasets.recorded.arrays import numbered
from sainet.datasets.recorded.mitpush.disk import MASS, PUSHER_RADIUS, RADIUS
from sainet.datasets.recorded.mitpush.endpoint_log import EndpointLog
from sainet.datasets.schema import RECORDED, StoreInfo, published_name, simulated_name
from sainet.engines.simulator import simulator_named
from sainet.scenes.scene import TIME_STEP

STROKE = 0.050  # m: recorded ones are within 0.7 mm of it
ASSUMED_ENGINE = "planar"
_CHUNK_SIZE = 250  # pushes


def store_info(log: EndpointLog) -> StoreInfo:
    """Return what the store of such pushes has in common."""
    return StoreInfo(
        kind="robot",
        pushes=log.size,
        bodies=1,
        steps=int(_steps(log).max()),
        chunk_size=_CHUNK_SIZE,
        time_step=TIME_STEP,
        engine=RECORDED,
        assumed_engines=(ASSUMED_ENGINE,),
        groups=tuple(sorted(set(_groups(log)))),
        published=(log.model,),
        has_repeats=log.plan is not None,
    )


def _steps(log: EndpointLog) -> np.ndarray:
    """Return how many steps each push lasts: those of the nominal stroke."""
    return np.rint(STROKE / log.speed / TIME_STEP).astype(np.int32)


def _groups(log: EndpointLog) -> list[str]:
    pairs = zip(log.surface, log.speed, strict=True)
    return [f"{surface}-{1000 * speed:.0f}" for surface, speed in pairs]


def to_arrays(
    log: EndpointLog, info: StoreInfo, contact_friction: float, table_friction: float
) -> dict[str, np.ndarray]:
    """Return every array of the store.

    Args:
        log: pushes of the disk alone.
        info: of the store.
        contact_friction: between pusher and disk.
        table_friction: between disk and table.

    Raises:
        Diverged: the assumed engine left the numbers.
    """
    every, single = np.ones(log.size, np.float32), np.ones((log.size, 1), np.float32)
    arrays = {
        "mass": MASS * single,
        "radius": RADIUS * single,
        "table_friction": table_friction * every,
        "disk_friction": contact_friction * every,
        "pusher_friction": contact_friction * every,
        "pusher_radius": PUSHER_RADIUS * every,
        "steps": _steps(log),
        "group": np.array([info.groups.index(name) for name in _groups(log)], np.int32),
        **_ends(log, info),
        **_path(log, info),
    }
    arrays = {
        k: v.astype(np.float32) if v.dtype == float else v for k, v in arrays.items()
    }
    arrays["truth_pusher"] = arrays["command_position"]
    if log.plan is not None:
        arrays["repeat"] = numbered(log.plan)
    names = [f"{log.path}: {place}" for place in log.places]
    motion = simulate(simulator_named(ASSUMED_ENGINE), arrays, info, names)
    return arrays | {simulated_name(ASSUMED_ENGINE): motion}


def _ends(log: EndpointLog, info: StoreInfo) -> dict[str, np.ndarray]:
    """Return what is known of the disk: at rest before, its pose at the last step."""
    push, last = np.arange(log.size), _steps(log) - 1
    initial = np.zeros((log.size, 1, 6))
    initial[:, 0, :3] = log.before
    truth = np.full((log.size, info.steps, 1, 6), np.nan, np.float32)
    truth[push, last, 0, :3] = _unwrapped(log.after, log.before)
    observed = np.zeros((log.size, info.steps), np.uint8)
    observed[push, last] = 1
    return {
        "initial": initial,
        "initial_pusher": log.tip_before,
        "truth": truth,
        "pose_observed": observed,
        "rate_observed": np.zeros_like(observed),
        published_name(log.model): _unwrapped(log.published, log.before)[:, None],
    }


def _unwrapped(
    pose: Float[np.ndarray, "push 3"], before: Float[np.ndarray, "push 3"]
) -> Float[np.ndarray, "push 3"]:
    """Bring angles (rad) to within half a turn of those before the push."""
    turn = np.mod(pose[:, 2] - before[:, 2] + np.pi, 2 * np.pi) - np.pi
    return np.column_stack([pose[:, :2], before[:, 2] + turn])


def _path(log: EndpointLog, info: StoreInfo) -> dict[str, np.ndarray]:
    """Return the pusher's straight way at constant speed; shorter pushes then hold."""
    steps = _steps(log)[:, None, None]
    step = np.arange(1, info.steps + 1)[None, :, None]
    way = (log.tip_after - log.tip_before)[:, None]
    travelled = np.minimum(step / steps, 1)
    return {
        "command_position": log.tip_before[:, None] + travelled * way,
        "command_velocity": (step <= steps) * way / (steps * info.time_step),
    }
