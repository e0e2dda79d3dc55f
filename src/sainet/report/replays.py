"""Pushes as they were and as models predict them: replays, and errors over time."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from sainet.datasets.batch import PushBatch, to_batch
from sainet.datasets.store import Store
from sainet.models.dynamics import predict
from sainet.models.model import Model
from sainet.report.episode_frames import EndRegion, Replay, Track
from sainet.scenes.state import Trajectory, poses_of


def build_replay(
    models: Sequence[Model], store: Store, push: int, *, title: str, steps: int
) -> Replay:
    """Return one push as it was and as each model predicts it.

    Args:
        models: in the order of the legend.
        store: holds the push.
        push: its index.
        title: of the replay.
        steps: how many to show, at most; a shorter push has fewer.
    """
    arrays = store.read(slice(push, push + 1))
    steps = min(steps, int(arrays["steps"][0]))
    batch = to_batch(arrays, store.info, steps=steps)
    pusher = _with_start(
        batch.initial.pusher_position, arrays["truth_pusher"][:, :steps]
    )
    motion = _with_start(poses_of(batch.initial), np.asarray(batch.truth[..., :3]))
    tracks = {"truth": Track(motion[..., :2], motion[..., 2], pusher)}
    tracks |= {model.name: _track(model, batch) for model in models}
    return Replay(
        title=title,
        time_step=store.info.time_step,
        radius=tuple(float(r) for r in arrays["radius"][0]),
        pusher_radius=float(arrays["pusher_radius"][0]),
        tracks=tracks,
        models=tuple(model.id for model in models),
    )


def error_curves(
    models: Sequence[Model], store: Store, *, steps: int, pushes: int
) -> dict[str, Float[np.ndarray, "time body"]]:
    """Return each model's mean position error (mm) over the time of a push.

    Args:
        models: by whose names the curves go.
        store: holds simulated pushes.
        steps: how many to predict.
        pushes: how many to average over, the first ones.
    """
    arrays = store.read(slice(0, min(pushes, store.info.pushes)))
    batch = to_batch(arrays, store.info, steps=steps)
    true = np.asarray(batch.truth[..., :2])
    seen = np.asarray(batch.pose_observed)[..., None]
    known = np.maximum(seen.sum(axis=0), 1)
    curves = {}
    for model in models:
        predicted = np.asarray(_predict(model, batch).states.position)
        error = 1000 * np.linalg.norm(predicted - true, axis=-1)
        curves[model.name] = np.where(seen, error, 0).sum(axis=0) / known
    return curves


def _predict(model: Model, batch: PushBatch) -> Trajectory:
    return predict(model.dynamics, batch.scene, batch.initial, batch.controls)


def _track(model: Model, batch: PushBatch) -> Track:
    """Return the track of a single push, with the region of its end if there is one."""
    states = _predict(model, batch).states
    motion = _with_start(poses_of(batch.initial), poses_of(states))
    start = batch.initial.pusher_position
    pusher = _with_start(start, np.asarray(states.pusher_position))
    region = model.dynamics.region(batch.scene, batch.initial, batch.controls)
    end = None
    if region is not None:
        axes, turn = np.asarray(region.axes[0]), np.asarray(region.turn[0])
        end = EndRegion(heading=float(region.heading[0]), axes=axes, turn=turn)
    return Track(motion[..., :2], motion[..., 2], pusher, end)


def _with_start(start: object, rest: np.ndarray) -> np.ndarray:
    """Put the state before the push in front of what follows, of a single push."""
    return np.concatenate([np.asarray(start), rest[0]], axis=0)
