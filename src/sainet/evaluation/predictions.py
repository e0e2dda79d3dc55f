"""Predictions of stored pushes by a model, and their signed errors."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from jaxtyping import Array, Bool, Float, Int

from sainet.datasets.batch import Prediction, PushBatch, shared_lengths, to_batch
from sainet.datasets.schema import input_names, published_name
from sainet.datasets.store import Store, last_known
from sainet.engines.devices import over_devices
from sainet.evaluation import metrics
from sainet.models.correctors import Region
from sainet.models.dynamics import AbstractDynamics, stored_prediction
from sainet.models.model import Model
from sainet.scenes.geometry import wrap_angle

OnPushes = Callable[[str, int], None]  # called with a model and its new predictions
# Pushes that are predicted at a time. Few are filled up, so that datasets of about one
# size share what is compiled.
_BATCH, _FEW = 256, 16


@dataclass(frozen=True)
class StoredPushes:
    """Stored pushes that models predict, up to a number of steps."""

    store: Store
    most: int  # steps to predict

    @cached_property
    def arrays(self) -> dict[str, np.ndarray]:
        """The arrays that every model needs: no prediction, no measured pose."""
        info = self.store.info
        names = [name for name in input_names(info) if name != "measured"]
        published = map(published_name, info.published)
        return self.store.read(slice(None), (*names, "group", *published))

    @cached_property
    def steps(self) -> Int[np.ndarray, " push"]:
        """The steps of each push to predict."""
        return np.minimum(self.arrays["steps"], self.most)

    @cached_property
    def exists(self) -> Bool[np.ndarray, "push time"]:
        """Whether a push has a step, up to the longest push."""
        return np.arange(self.steps.max())[None] < self.steps[:, None]

    @cached_property
    def truth(self) -> Float[np.ndarray, "push time body 3"]:
        """The true poses (m, rad)."""
        longest = self.exists.shape[1]
        return self.arrays["truth"][:, :longest, :, :3].astype(np.float64)

    @cached_property
    def observed(self) -> Bool[np.ndarray, "push time"]:
        """Where the true poses are known."""
        known = self.arrays["pose_observed"][:, : self.exists.shape[1]] > 0
        return known & self.exists

    @cached_property
    def final(self) -> Float[np.ndarray, "push body 3"]:
        """The last observed pose of each push."""
        return last_known(self.truth, self.observed)

    def errors(self, poses: Float[np.ndarray, "push time body 3"]) -> metrics.Errors:
        """Return the errors of predicted poses."""
        return metrics.push_errors(poses, self.truth, self.observed)

    def batches(
        self,
        steps: Int[np.ndarray, " push"],
        arrays: Mapping[str, np.ndarray] | None = None,
        few: int = _FEW,
        simulated: str | None = None,
    ) -> Iterator[tuple[np.ndarray, PushBatch]]:
        """Yield indices of pushes that are read for equal steps, and their batch.

        Args:
            steps: that each push is read for.
            arrays: of the pushes; None: those that every model needs.
            few: a batch is filled up to a multiple of this, by repeats.
            simulated: internal engine whose prediction is among the arrays.
        """
        arrays = arrays or self.arrays
        for length in np.unique(steps):
            part = np.flatnonzero(steps == length)
            for start in range(0, len(part), _BATCH):
                rows = part[start : start + _BATCH]
                whole = np.resize(rows, min(_BATCH, -(-len(part) // few) * few))
                some = {name: array[whole] for name, array in arrays.items()}
                info = self.store.info
                yield rows, to_batch(some, info, steps=int(length), simulated=simulated)


def predict_all(
    model: Model, pushes: StoredPushes, on_pushes: OnPushes
) -> Float[np.ndarray, "push time body 3"]:
    """Return the predicted poses (m, rad), zero after the end of a push.

    Raises:
        Diverged: a prediction is not finite.
    """
    store, arrays, read = pushes.store, pushes.arrays, pushes.steps
    few = 1 if model.dynamics.on_host and not model.card else _FEW  # none compiled
    if not model.dynamics.on_host:  # what follows the end of a push does not change it
        read = shared_lengths(read)
    found = np.zeros((*pushes.exists.shape, store.info.bodies, 3))
    stored = None
    if model.internal and (known := Prediction(model.internal, store.info)).is_stored:
        arrays = arrays | store.read(slice(None), (known.name,))
        stored = model.internal.simulator.stored_as
    for rows, batch in pushes.batches(read, arrays, few, stored):
        pose = np.asarray(_run(_predict_pose, model.dynamics, batch))
        found[rows, : pose.shape[1]] = pose[: len(rows)]
        on_pushes(model.name, len(rows))
    found[~pushes.exists] = 0
    metrics.check_finite(model.name, store.path, found)
    return found


def regions_of(
    dynamics: AbstractDynamics, pushes: StoredPushes
) -> Iterator[tuple[np.ndarray, Region]]:
    """Yield indices of pushes and the regions of their ends; nothing without regions.

    Networks may drift after the end of a push, so pushes are read to their ends only.
    """
    for rows, batch in pushes.batches(pushes.steps) if dynamics.has_regions else ():
        if region := _run(_region, dynamics, batch):
            yield rows, Region._make(np.asarray(x)[: len(rows)] for x in region)


def _run(
    function: Callable[..., Any], dynamics: AbstractDynamics, batch: PushBatch
) -> Any:  # noqa: ANN401
    if dynamics.on_host:  # compiled, its results would differ in their last bits
        return function(dynamics, batch)
    return over_devices(function, dynamics, batch)


def _region(dynamics: AbstractDynamics, batch: PushBatch) -> Region | None:
    return dynamics.region(batch.scene, batch.initial, batch.controls)


def _predict_pose(
    dynamics: AbstractDynamics, batch: PushBatch
) -> Float[Array, "push time body 3"]:
    stored = batch.simulated
    if stored is not None:
        stored = stored_prediction(stored, batch.initial, batch.controls)
    carry = dynamics.begin(batch.scene, batch.initial)
    return dynamics.advance(batch.scene, carry, batch.controls, stored)[1].states.pose


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
    arrays = pushes.arrays
    poses = predict_all(model, pushes, lambda name, count: None)
    missed = (pushes.final - last_known(poses, pushes.observed))[:, 0]
    last = arrays["command_position"][np.arange(len(missed)), arrays["steps"] - 1]
    stroke = (last - arrays["initial_pusher"]).astype(np.float64)
    return EndOffsets(
        place=arrays["initial"][:, 0, :2].astype(np.float64),
        heading=np.arctan2(stroke[:, 1], stroke[:, 0]),
        offset=missed[:, :2],
        turn=wrap_angle(missed[:, 2]),
    )
