"""Predictions of stored pushes by a model, and their signed errors."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from sainet.datasets.batch import Prediction, PushBatch, shared_lengths, to_batch
from sainet.datasets.schema import input_names, published_name
from sainet.datasets.store import Store, last_known
from sainet.engines.devices import over_devices
from sainet.evaluation import metrics
from sainet.models.dynamics import AbstractDynamics, stored_prediction
from sainet.models.model import Model
from sainet.scenes.geometry import wrap_angle

OnPushes = Callable[[str, int], None]  # called with a model and its new predictions
# Pushes that are predicted at a time. Few are filled up, so that datasets of about one
# size share what is compiled.
_BATCH, _FEW = 256, 16
Part = tuple[np.ndarray, int]  # indices of pushes of one length, and their steps


@dataclass(frozen=True)
class StoredPushes:
    """Stored pushes in parts of one length."""

    store: Store
    most: int  # steps to predict

    @cached_property
    def arrays(self) -> dict[str, np.ndarray]:
        """The arrays that every model needs: no prediction, no measured pose."""
        info = self.store.info
        names = [name for name in input_names(info) if name != "measured"]
        published = map(published_name, info.published)
        return self.store.read(slice(None), (*names, "group", *published))

    @property
    def steps(self) -> Int[np.ndarray, " push"]:
        """The steps of each push to predict."""
        return np.minimum(self.arrays["steps"], self.most)

    @cached_property
    def parts(self) -> list[Part]:
        """The pushes of each length."""
        return _of_one_length(self.steps)

    def truths(self) -> list[tuple[np.ndarray, np.ndarray]]:
        """Return the true poses (m, rad) of each part, and where they are known."""
        pose, observed = self.arrays["truth"], self.arrays["pose_observed"]
        return [
            (pose[part, :steps, :, :3].astype(np.float64), observed[part, :steps] > 0)
            for part, steps in self.parts
        ]

    def in_order(self, values: Sequence[np.ndarray]) -> np.ndarray:
        """Return values of all parts in the order of the store."""
        order = np.argsort(np.concatenate([part for part, _ in self.parts]))
        return np.concatenate(values)[order]

    @cached_property
    def final(self) -> Float[np.ndarray, "push body 3"]:
        """The last observed pose of each push."""
        return self.in_order([last_known(*truth) for truth in self.truths()])

    def errors(self, poses: Sequence[np.ndarray]) -> metrics.Errors:
        """Return the errors of the predicted poses of each part."""
        pairs = zip(poses, self.truths(), strict=True)
        found = [metrics.push_errors(predicted, *truth) for predicted, truth in pairs]
        return {
            name: self.in_order([e[name] for e in found]) for name in metrics.MEASURED
        }


def predict_all(
    model: Model, pushes: StoredPushes, on_pushes: OnPushes
) -> list[np.ndarray]:
    """Return the predicted poses of each part, ``[push, time, body, 3]``.

    Raises:
        Diverged: a prediction is not finite.
    """
    store, arrays, read = pushes.store, pushes.arrays, pushes.steps
    few = 1 if model.dynamics.on_host and not model.card else _FEW  # none compiled
    if not model.dynamics.on_host:  # what follows the end of a push does not change it
        read = shared_lengths(read)
    found = np.empty((len(read), read.max(), store.info.bodies, 3))
    stored = None
    if model.internal and (known := Prediction(model.internal, store.info)).is_stored:
        arrays = arrays | store.read(slice(None), (known.name,))
        stored = model.internal.simulator.stored_as
    for part, steps in _of_one_length(read):
        for start in range(0, len(part), _BATCH):
            rows = part[start : start + _BATCH]
            whole = np.resize(rows, min(_BATCH, -(-len(part) // few) * few))
            some = {name: array[whole] for name, array in arrays.items()}
            batch = to_batch(some, store.info, steps=steps, simulated=stored)
            pose = _predict(model.dynamics, batch)
            found[rows, :steps] = np.asarray(pose)[: len(rows)]
            on_pushes(model.name, len(rows))
    poses = [found[part, :steps] for part, steps in pushes.parts]
    for (part, _), each in zip(pushes.parts, poses, strict=True):
        metrics.check_finite(model.name, store.path, each, part)
    return poses


def _of_one_length(steps: Int[np.ndarray, " push"]) -> list[Part]:
    return [(np.flatnonzero(steps == n), int(n)) for n in np.unique(steps)]


def _predict(dynamics: AbstractDynamics, batch: PushBatch) -> Array:
    if dynamics.on_host:  # compiled, its results would differ in their last bits
        return _predict_pose(dynamics, batch)
    return over_devices(_predict_pose, dynamics, batch)


def _predict_pose(
    dynamics: AbstractDynamics, batch: PushBatch
) -> Float[Array, "push time body 3"]:
    stored = batch.simulated
    if stored is not None:
        stored = stored_prediction(stored, batch.initial, batch.controls)
    carry = dynamics.begin(batch.scene, batch.initial)
    _, trajectory = dynamics.advance(batch.scene, carry, batch.controls, stored)
    states = trajectory.states
    return jnp.concatenate([states.position, states.angle[..., None]], axis=-1)


@dataclass(frozen=True)
class EndOffsets:
    """Signed errors of a model at the ends of pushes, of the pushed disk."""

    place: Float[np.ndarray, "push 2"]  # m, of the disk before the push
    heading: Float[np.ndarray, " push"]  # rad, of the push on the table
    offset: Float[np.ndarray, "push 2"]  # m, observed minus predicted, on the table
    turn: Float[np.ndarray, " push"]  # rad, observed minus predicted

    @property
    def along(self) -> Float[np.ndarray, " push"]:
        """The offset along the push (m)."""
        return np.sum(self.offset * self._ahead, axis=-1)

    @property
    def across(self) -> Float[np.ndarray, " push"]:
        """The offset to the left of the push (m)."""
        x, y = self._ahead.T
        return self.offset[:, 1] * x - self.offset[:, 0] * y

    @property
    def _ahead(self) -> Float[np.ndarray, "push 2"]:
        return np.column_stack([np.cos(self.heading), np.sin(self.heading)])


def end_offsets(model: Model, store: Store) -> EndOffsets:
    """Predict every push along a path and return the signed errors of its end.

    Args:
        model: predicts.
        store: of pushes along paths, observed at least at their ends; NaN otherwise.
    """
    pushes = StoredPushes(store, store.info.steps)
    arrays, truths = pushes.arrays, pushes.truths()
    poses = predict_all(model, pushes, lambda name, count: None)
    predicted = [
        last_known(p, seen) for p, (_, seen) in zip(poses, truths, strict=True)
    ]
    missed = (pushes.final - pushes.in_order(predicted))[:, 0]
    last = arrays["command_position"][np.arange(len(missed)), arrays["steps"] - 1]
    stroke = (last - arrays["initial_pusher"]).astype(np.float64)
    return EndOffsets(
        place=arrays["initial"][:, 0, :2].astype(np.float64),
        heading=np.arctan2(stroke[:, 1], stroke[:, 0]),
        offset=missed[:, :2],
        turn=wrap_angle(missed[:, 2]),
    )
