"""Replays and error curves of stored pushes, for figures and the report."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from sainet.datasets.batch import PushBatch, to_batch
from sainet.datasets.store import Store
from sainet.models.dynamics import predict
from sainet.models.library import Model
from sainet.report.replay import Replay, Track
from sainet.scenes.state import State, Trajectory


def build_replay(
    models: Sequence[Model], store: Store, push: int, *, title: str, steps: int
) -> Replay:
    """Return one push as it was and as each model predicts it.

    Args:
        models: in the order of the legend.
        store: holds the push.
        push: its index.
        title: of the replay.
        steps: how many to show.
    """
    arrays = store.read(slice(push, push + 1))
    batch = to_batch(arrays, store.info, steps=steps)
    pusher = _with_start(
        batch.initial.pusher_position, arrays["truth_pusher"][:, :steps]
    )
    motion = _with_start(_pose(batch.initial), np.asarray(batch.truth[..., :3]))
    tracks = {"truth": Track(motion[..., :2], motion[..., 2], pusher)}
    for model in models:
        tracks[model.name] = _track(_predict(model, batch), batch.initial)
    return Replay(
        title=title,
        time_step=store.info.time_step,
        radius=tuple(float(r) for r in arrays["radius"][0]),
        pusher_radius=float(arrays["pusher_radius"][0]),
        tracks=tracks,
    )


def error_curves(
    models: Sequence[Model], store: Store, *, steps: int, pushes: int
) -> dict[str, Float[np.ndarray, "time body"]]:
    """Return each model's mean position error (mm) over the time of a push."""
    arrays = store.read(slice(0, min(pushes, store.info.pushes)))
    batch = to_batch(arrays, store.info, steps=steps)
    true = np.asarray(batch.truth[..., :2])
    curves = {}
    for model in models:
        predicted = np.asarray(_predict(model, batch).states.position)
        error = 1000 * np.linalg.norm(predicted - true, axis=-1)
        curves[model.name] = error.mean(axis=0)
    return curves


def _predict(model: Model, batch: PushBatch) -> Trajectory:
    return predict(model.dynamics, batch.scene, batch.initial, batch.controls)


def _track(trajectory: Trajectory, initial: State) -> Track:
    states = trajectory.states
    pose = np.concatenate(
        [np.asarray(states.position), np.asarray(states.angle)[..., None]], axis=-1
    )
    motion = _with_start(_pose(initial), pose)
    pusher = _with_start(initial.pusher_position, np.asarray(states.pusher_position))
    return Track(motion[..., :2], motion[..., 2], pusher)


def _pose(state: State) -> np.ndarray:
    angle = np.asarray(state.angle)[..., None]
    return np.concatenate([np.asarray(state.position), angle], axis=-1)


def _with_start(start: object, rest: np.ndarray) -> np.ndarray:
    """Put the state before the push in front of what follows, of a single push."""
    return np.concatenate([np.asarray(start), rest[0]], axis=0)
