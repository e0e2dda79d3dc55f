"""Several models on the same stored pushes, side by side."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, partial

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from sainet.datasets.batch import Prediction, PushBatch, to_batch
from sainet.datasets.schema import input_names, published_name
from sainet.datasets.store import Store
from sainet.engines.devices import over_devices
from sainet.evaluation import coverage, measurements, metrics
from sainet.evaluation.parts import Parts
from sainet.models.card import Card
from sainet.models.dynamics import AbstractDynamics, stored_prediction
from sainet.models.identity import ModelId
from sainet.models.model import Model
from sainet.models.process_card import ProcessCard
from sainet.runs.errors import BadInput

PAPER_STEPS = 200
OnPushes = Callable[[str, int], None]  # called with a model and its new predictions
_BATCH = 256  # pushes that are predicted at a time: one compilation for each length


def evaluate(
    models: Sequence[Model],
    store: Store,
    *,
    steps: int | None = None,
    force: bool = False,
    on_pushes: OnPushes = lambda model, pushes: None,
    parts: Parts | None = None,
) -> measurements.Measurements:
    """Predict every stored push with every model and measure the errors.

    Args:
        models: at least one.
        store: the pushes.
        steps: to predict; 0 is all, None the paper's 200 (recorded pushes: all).
        force: use networks on other pushes than they were trained for.
        on_pushes: called with the model and the number of pushes predicted since.
        parts: keeps the errors of each model; None keeps nothing.

    Raises:
        BadCheckpoint: a network does not fit the pushes.
        BadInput: two models have the same name.
        Diverged: a prediction is not finite.
    """
    names = [model.name for model in models]
    if len(set(names)) < len(names):
        every = ", ".join(names)
        raise BadInput(f"`model`: {every} are not all different; rename one.")
    info = store.info
    fitted = any(model.card or model.identified for model in models)
    hashes = store.push_hashes() if fitted and not force else None
    for model in () if force else models:
        model.check_fits(info.kind, info.time_step, seed=info.seed, pushes=hashes)
    pushes = _Pushes(store, _limit(store, steps))
    made = {m.name: partial(_errors, m, pushes, on_pushes) for m in models}
    errors = [parts.errors(k, make) if parts else make() for k, make in made.items()]
    return _measurements(models, pushes, errors)


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
    pushes = _Pushes(store, store.info.steps)
    arrays, truths = pushes.arrays, pushes.truths()
    poses = _predict_all(model, pushes, lambda name, count: None)
    predicted = [
        metrics.final_pose(p, seen) for p, (_, seen) in zip(poses, truths, strict=True)
    ]
    missed = (pushes.final - pushes.in_order(predicted))[:, 0]
    last = arrays["command_position"][np.arange(len(missed)), arrays["steps"] - 1]
    stroke = (last - arrays["initial_pusher"]).astype(np.float64)
    return EndOffsets(
        place=arrays["initial"][:, 0, :2].astype(np.float64),
        heading=np.arctan2(stroke[:, 1], stroke[:, 0]),
        offset=missed[:, :2],
        turn=np.mod(missed[:, 2] + np.pi, 2 * np.pi) - np.pi,
    )


@dataclass(frozen=True)
class _Pushes:
    """Stored pushes in parts of one length: each part is compiled for once."""

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
    def parts(self) -> list[tuple[np.ndarray, int]]:
        """The indices of the pushes of each length, and the steps to predict."""
        lengths = np.minimum(self.arrays["steps"], self.most)
        return [(np.flatnonzero(lengths == n), int(n)) for n in np.unique(lengths)]

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
        return self.in_order([metrics.final_pose(*truth) for truth in self.truths()])

    def errors(self, poses: Sequence[np.ndarray]) -> metrics.Errors:
        """Return the errors of the predicted poses of each part."""
        pairs = zip(poses, self.truths(), strict=True)
        found = [metrics.push_errors(predicted, *truth) for predicted, truth in pairs]
        return {
            name: self.in_order([e[name] for e in found]) for name in metrics.MEASURED
        }


def _limit(store: Store, steps: int | None) -> int:
    if steps is None:
        recorded = store.info.is_recorded
        return store.info.steps if recorded else min(PAPER_STEPS, store.info.steps)
    if not 0 <= steps <= store.info.steps:
        raise BadInput(
            f"`steps` is {steps}; {store.path} has {store.info.steps} (0 takes all)."
        )
    return steps or store.info.steps


def _errors(model: Model, pushes: _Pushes, on_pushes: OnPushes) -> metrics.Errors:
    store, longest = pushes.store, max(steps for _, steps in pushes.parts)
    given = model.dynamics.recall(store.push_hashes, longest, store.info.bodies)
    if given is None:
        poses = _predict_all(model, pushes, on_pushes)
        return pushes.errors(poses) | _coverage(model, pushes, poses)
    on_pushes(model.name, len(given))
    if given.ndim == pushes.final.ndim:
        return metrics.final_errors(given, pushes.final)
    return pushes.errors([given[part, :steps] for part, steps in pushes.parts])


def _coverage(
    model: Model, pushes: _Pushes, poses: Sequence[np.ndarray]
) -> metrics.Errors:
    """Return the measurements of the regions in which the model expects the ends."""
    arrays, info = pushes.arrays, pushes.store.info
    batches = (
        to_batch({k: array[part] for k, array in arrays.items()}, info, steps=steps)
        for part, steps in pushes.parts
    )
    found = coverage.of_parts(model.dynamics, batches, poses, pushes.truths())
    return {k: pushes.in_order(values) for k, values in found.items()}


def _predict_all(
    model: Model, pushes: _Pushes, on_pushes: OnPushes
) -> list[np.ndarray]:
    """Return the predicted poses of each part, ``[push, time, body, 3]``."""
    store, arrays = pushes.store, pushes.arrays
    poses: list[np.ndarray] = []
    stored = None
    if model.internal and (known := Prediction(model.internal, store.info)).is_stored:
        arrays = arrays | store.read(slice(None), (known.name,))
        stored = model.internal.simulator.stored_as
    for part, steps in pushes.parts:
        found: list[np.ndarray] = []
        for start in range(0, len(part), _BATCH):
            rows = part[start : start + _BATCH]
            whole = np.resize(rows, min(_BATCH, len(part)))
            some = {name: array[whole] for name, array in arrays.items()}
            batch = to_batch(some, store.info, steps=steps, simulated=stored)
            pose = _predict(model.dynamics, batch)
            found.append(np.asarray(pose, np.float64)[: len(rows)])
            on_pushes(model.name, len(rows))
        poses.append(np.concatenate(found))
        metrics.check_finite(model.name, store.path, poses[-1], part)
    return poses


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


def _measurements(
    models: Sequence[Model], pushes: _Pushes, errors: list[metrics.Errors]
) -> measurements.Measurements:
    store, arrays, final = pushes.store, pushes.arrays, pushes.final
    errors = errors + [
        metrics.final_errors(arrays[published_name(name)].astype(np.float64), final)
        for name in store.info.published
    ]
    groups = store.info.groups
    labels = sorted({groups[code] for code in arrays["group"]}) if groups else [""]
    places = [labels.index(groups[code] if groups else "") for code in arrays["group"]]
    rows = np.arange(store.info.pushes) if store.rows is None else np.array(store.rows)
    unknown = np.full(final.shape[:2], np.nan)
    names = dict.fromkeys(name for each in errors for name in each)
    return measurements.measurements_of(
        {k: np.stack([each.get(k, unknown)[None] for each in errors]) for k in names},
        metrics.travel_mm(arrays["initial"][..., :3].astype(np.float64), final),
        _header(models, store, labels),
        condition=np.array(places),
        row=rows,
    )


def _header(
    models: Sequence[Model], store: Store, labels: Sequence[str]
) -> measurements.Header:
    published = store.info.published
    kind = "recorded" if store.info.is_recorded else "simulated"
    return measurements.Header(
        models=(
            *(model.id for model in models),
            *(ModelId(kind="published", name=name) for name in published),
        ),
        predictions=tuple(published),
        conditions=tuple(measurements.Condition(label=label) for label in labels),
        reference_m=metrics.REFERENCE_DISTANCE[kind],
        provenance=measurements.Provenance(
            tests=tuple(
                measurements.TestSet(condition=c, data=store.content) for c in labels
            ),
            trainings=tuple(_training(m.name, m.card) for m in models if m.card),
        ),
    )


def _training(name: str, card: Card | ProcessCard) -> measurements.TrainingRun:
    return measurements.TrainingRun(
        model=name,
        seed=card.recipe.seed,
        weights=card.weights,
        data=card.data,
        iterations=card.recipe.iterations,
        final_loss=card.final_loss,
    )
