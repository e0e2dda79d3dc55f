"""Several models on the same stored pushes, side by side."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import combinations
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from sainet.datasets.batch import PushBatch, to_batch
from sainet.datasets.schema import published_name, simulated_name, variables
from sainet.datasets.store import Store
from sainet.engines.devices import over_devices
from sainet.evaluation.intervals import Folds
from sainet.evaluation.metrics import (
    REFERENCE_DISTANCE,
    PushErrors,
    final_errors,
    final_pose,
    pooled,
    push_errors,
    travel_mm,
)
from sainet.evaluation.rows import comparison_rows, error_rows
from sainet.models.dynamics import AbstractDynamics
from sainet.models.model import Model
from sainet.runs.errors import BadInput, Diverged

PAPER_STEPS = 200
_BATCH = 256  # pushes that are predicted at a time: one compilation for each length


@dataclass
class Evaluation:
    """Errors of every model for every push; `to_dict` is what tables show."""

    errors: dict[str, PushErrors]
    published: dict[str, PushErrors]
    travel_mm: Float[np.ndarray, "push body"]
    groups: tuple[str | None, ...]  # of each push
    reference: float  # m, that trans (%) is relative to
    curves: dict[str, np.ndarray] = field(default_factory=dict)
    folds: Folds | None = None  # of each push, in a cross-validation

    def to_dict(self) -> dict[str, Any]:
        """Return rows, published rows and paired comparisons as JSON values."""
        pairs = combinations(self.errors.items(), 2)
        return {
            "rows": self._rows(self.errors),
            "published": list(map(_without_intervals, self._rows(self.published))),
            "comparisons": [
                row
                for (one, a), (other, b) in pairs
                for group, part in self._parts()
                for row in comparison_rows(
                    (other, b.of_pushes(part)),
                    (one, a.of_pushes(part)),
                    group=group,
                    folds=self.folds_of(part),
                )
            ],
        }

    def pool(self, name: str, members: Sequence[str]) -> None:
        """Make one model of several trainings of it, in the place of the first."""
        found = {member: self.errors[member] for member in members}
        whole = pooled(list(found.values()))
        self.errors = {
            name if model == members[0] else model: whole if model in found else errors
            for model, errors in self.errors.items()
            if model not in members[1:]
        }

    def _rows(self, errors: dict[str, PushErrors]) -> list[dict[str, Any]]:
        """Return the rows of each group, in it of each model."""
        return [
            row
            for group, part in self._parts()
            for name, found in errors.items()
            for row in error_rows(
                name,
                found.of_pushes(part),
                self.travel_mm[part],
                group=group,
                reference=self.reference,
                folds=self.folds_of(part),
            )
        ]

    def folds_of(self, part: np.ndarray) -> Folds | None:
        """Return the folds of some pushes, if there are any."""
        if self.folds is None:
            return None
        return tuple(np.array(self.folds)[part].tolist())

    def _parts(self) -> Iterator[tuple[str | None, np.ndarray]]:
        """Yield each group and which pushes belong to it."""
        owners = np.array([group or "" for group in self.groups])
        for name in sorted(set(owners)):
            yield name or None, owners == name


def _without_intervals(row: dict[str, Any]) -> dict[str, Any]:
    return {k: v for k, v in row.items() if not k.endswith("_interval")}


def evaluate(
    models: Sequence[Model],
    store: Store,
    *,
    steps: int | None = None,
    force: bool = False,
    on_pushes: Callable[[str, int], None] = lambda model, pushes: None,
) -> Evaluation:
    """Predict every stored push with every model and measure the errors.

    Args:
        models: at least one.
        store: the pushes.
        steps: to predict; 0 is all, None the paper's 200 (recorded pushes: all).
        force: use networks on other pushes than they were trained for.
        on_pushes: told the model and how many pushes were predicted.

    Raises:
        BadCheckpoint: a network does not fit the pushes.
        BadInput: two models have the same name.
        Diverged: a prediction left the finite numbers.
    """
    names = [model.name for model in models]
    if len(set(names)) < len(names):
        raise BadInput(
            f"`model`: {', '.join(names)} are not all different; rename one."
        )
    info = store.info
    hashes = store.push_hashes() if info.is_recorded and not force else None
    for model in () if force else models:
        model.check_fits(info.kind, info.time_step, seed=info.seed, pushes=hashes)
    arrays = _read(store)
    limit = _limit(store, steps)
    parts = list(_parts_of_one_length(arrays, limit))
    errors: dict[str, PushErrors] = {}
    for model in models:
        poses = _predict_all(model, store, arrays, parts, on_pushes)
        errors[model.name] = _join(
            [
                push_errors(poses[i], *_truth(arrays, part, length))
                for i, (part, length) in enumerate(parts)
            ],
            parts,
        )
    return _evaluation(store, arrays, errors, parts)


def predict_ends(
    model: Model, store: Store
) -> tuple[Float[np.ndarray, "push body 3"], Float[np.ndarray, "push body 3"]]:
    """Return predicted and observed poses (m, rad) at the last observed steps.

    Args:
        model: predicts.
        store: of pushes that were observed at their ends at least; NaN otherwise.
    """
    arrays = _read(store)
    parts = list(_parts_of_one_length(arrays, store.info.steps))
    poses = _predict_all(model, store, arrays, parts, lambda name, pushes: None)
    order = np.argsort(np.concatenate([part for part, _ in parts]))
    truths = [_truth(arrays, part, steps) for part, steps in parts]
    predicted = [
        final_pose(pose, seen) for pose, (_, seen) in zip(poses, truths, strict=True)
    ]
    observed = [final_pose(*truth) for truth in truths]
    return np.concatenate(predicted)[order], np.concatenate(observed)[order]


def _read(store: Store) -> dict[str, np.ndarray]:
    unused = {simulated_name(engine) for engine in store.info.assumed_engines}
    names = tuple(n for n in variables(store.info) if n not in {*unused, "measured"})
    return store.read(slice(None), names)


def _limit(store: Store, steps: int | None) -> int:
    if steps is None:
        recorded = store.info.is_recorded
        return store.info.steps if recorded else min(PAPER_STEPS, store.info.steps)
    if not 0 <= steps <= store.info.steps:
        raise BadInput(
            f"`steps` is {steps}; {store.path} has {store.info.steps} (0 takes all)."
        )
    return steps or store.info.steps


def _parts_of_one_length(
    arrays: dict[str, np.ndarray], limit: int
) -> Iterator[tuple[np.ndarray, int]]:
    """Yield the indices of pushes of one length, and how much of it is predicted."""
    lengths = np.minimum(arrays["steps"], limit)
    for length in np.unique(lengths):
        yield np.flatnonzero(lengths == length), int(length)


def _truth(
    arrays: dict[str, np.ndarray], part: np.ndarray, steps: int
) -> tuple[np.ndarray, np.ndarray]:
    pose = arrays["truth"][part, :steps, :, :3].astype(np.float64)
    return pose, arrays["pose_observed"][part, :steps] > 0


def _predict_all(
    model: Model,
    store: Store,
    arrays: dict[str, np.ndarray],
    parts: list[tuple[np.ndarray, int]],
    on_pushes: Callable[[str, int], None],
) -> list[np.ndarray]:
    """Return the predicted poses of each part, ``[push, time, body, 3]``."""
    poses = []
    for part, steps in parts:
        found = []
        for start in range(0, len(part), _BATCH):
            rows = part[start : start + _BATCH]
            whole = np.resize(rows, min(_BATCH, len(part)))
            batch = to_batch(_rows(arrays, whole), store.info, steps=steps)
            pose = _predict(model.dynamics, batch)
            found.append(np.asarray(pose, np.float64)[: len(rows)])
            on_pushes(model.name, len(rows))
        poses.append(np.concatenate(found))
        _check_finite(model, store, poses[-1], part)
    return poses


def _check_finite(
    model: Model, store: Store, poses: np.ndarray, part: np.ndarray
) -> None:
    """Raise `Diverged` if a pose is not finite: no mean of the model would be known."""
    lost = part[~np.isfinite(poses).all(axis=(1, 2, 3))]
    if len(lost):
        raise Diverged(
            f"{model.name}: what it predicts of push {lost[0]} of {store.path} is not "
            f"finite, nor of {len(lost) - 1} more of {len(part)}; leave it out, or "
            "train it again."
        )


def _rows(arrays: dict[str, np.ndarray], rows: np.ndarray) -> dict[str, np.ndarray]:
    return {name: array[rows] for name, array in arrays.items()}


def _predict(dynamics: AbstractDynamics, batch: PushBatch) -> Array:
    if dynamics.on_host:  # it uses every core by itself
        return _predict_pose(dynamics, batch)
    return over_devices(_predict_pose, dynamics, batch)


def _predict_pose(
    dynamics: AbstractDynamics, batch: PushBatch
) -> Float[Array, "push time body 3"]:
    carry = dynamics.begin(batch.scene, batch.initial)
    _, trajectory = dynamics.advance(batch.scene, carry, batch.controls)
    states = trajectory.states
    return jnp.concatenate([states.position, states.angle[..., None]], axis=-1)


def _join(errors: list[PushErrors], parts: list[tuple[np.ndarray, int]]) -> PushErrors:
    """Put the errors of all parts back into the order of the store."""
    order = np.argsort(np.concatenate([part for part, _ in parts]))
    stacked = {
        name: np.concatenate([vars(e)[name] for e in errors])[order]
        for name in vars(errors[0])
    }
    return PushErrors(**stacked)


def _evaluation(
    store: Store,
    arrays: dict[str, np.ndarray],
    errors: dict[str, PushErrors],
    parts: list[tuple[np.ndarray, int]],
) -> Evaluation:
    order = np.argsort(np.concatenate([part for part, _ in parts]))
    ends = [final_pose(*_truth(arrays, part, steps)) for part, steps in parts]
    final = np.concatenate(ends)[order]
    recorded = store.info.is_recorded
    names = store.info.groups
    return Evaluation(
        errors=errors,
        published={
            name: final_errors(arrays[published_name(name)].astype(np.float64), final)
            for name in store.info.published
        },
        travel_mm=travel_mm(arrays["initial"][..., :3].astype(np.float64), final),
        groups=tuple(names[code] if names else None for code in arrays["group"]),
        reference=REFERENCE_DISTANCE["recorded" if recorded else "simulated"],
    )
