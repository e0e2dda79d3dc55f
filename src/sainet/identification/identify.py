"""Fit the planar engine's parameters to observed pushes, by gradient through it."""

import logging
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

import jax.numpy as jnp
import numpy as np

from sainet.datasets.store import Store
from sainet.engines.identified import FILE, FRICTIONS, NAMES, read_values
from sainet.identification.intervals import intervals
from sainet.identification.parameters import (
    BOUNDS,
    Estimate,
    doubt,
    names_for,
    starting_values,
)
from sainet.identification.residuals import Sample, Scale, pose_errors, samples
from sainet.identification.solve import Try, solve
from sainet.runs.documents import read_json, write_json
from sainet.runs.errors import BadInput, BadStore
from sainet.runs.folders import open_run, remake

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Identified:
    """What was found, and how much better the engine is for it."""

    estimates: tuple[Estimate, ...]
    pushes: int
    before_mm: float  # mean position error where the pushes were observed
    after_mm: float
    before_deg: float
    after_deg: float

    def to_dict(self) -> dict[str, Any]:
        """Return it as JSON values; `values` is what an engine is made of."""
        values = {estimate.name: estimate.value for estimate in self.estimates}
        return {"values": values, **asdict(self)}


def identify_into(
    store: Store, out: Path, *, on_try: Try = lambda error: None
) -> dict[str, Any]:
    """Identify an engine's parameters into a run folder; again is no work.

    Args:
        store: see `identify`.
        out: the run folder.
        on_try: see `identify`.

    Returns:
        What `Identified.to_dict` says, as it is kept in `identified.json`.

    Raises:
        RunConflict: the folder holds something else.
        BadStore: see `identify`.
        BadInput: the folder was finished and is damaged.
    """
    settings = {"command": "identify", "data": store.content, "parameters": NAMES}
    check_store(store)
    folder = open_run(out, settings, finished_by=FILE)
    if not folder.is_finished:
        write_json(out / FILE, identify(store, on_try=on_try).to_dict())
    return _read_found(out)


def _read_found(out: Path) -> dict[str, Any]:
    read_values(out)
    found = read_json(out / FILE)
    for field in fields(Identified):
        if field.name not in found:
            raise BadInput(f"{out / FILE}: {field.name} is missing; {remake(out)}.")
    return found


def check_store(store: Store) -> None:
    """Raise `BadStore` if no parameter can be identified from such pushes."""
    if not store.read(slice(None), ("pose_observed",))["pose_observed"].any():
        raise BadStore(f"{store.path}: no pose was observed; there is nothing to fit.")
    if store.info.kind != "robot":
        raise BadStore(
            f"{store.path}: kind is {store.info.kind!r}; parameters are identified "
            "from pushes along paths: give pushes of the robot setup."
        )
    for name, values in store.read(slice(None), FRICTIONS).items():
        if not values.mean() > 0:
            raise BadStore(
                f"{store.path}: {name} is {values.mean():g}; parameters are looked for "
                "around a friction: import or generate the pushes with one."
            )


def identify(store: Store, *, on_try: Try = lambda error: None) -> Identified:
    """Fit frictions, pressure distribution and where the camera sees the disks.

    Nonlinear least squares (SciPy, robust against outliers) on position and rotation at
    the observed steps, each measured by how wrong the engine is at the start. The 95 %
    intervals are of a bootstrap over pushes, each resample one Gauss-Newton step away.
    What the data cannot tell stays as the scenes have it, and the rest is fitted again.

    Args:
        store: of pushes along paths, observed at their ends at least.
        on_try: told the error of all values that are tried, root mean square; at the
            start it is about 1.

    Raises:
        BadStore: nothing of its pushes was observed, or forces drive them.
    """
    check_store(store)
    parts = samples(store)
    scenes = [part.batch.scene for part in parts]
    start = starting_values(scenes, names_for(scenes[0]))
    _tell_of_one_value(store, start)
    before, scale = _mean_errors(start, parts), _scale(start, parts)
    values, known, doubtful = start, {}, {}
    while len(doubtful) < len(start):
        free = [name for name in start if name not in doubtful]
        values = solve(start, free, scale, parts, on_try=on_try)
        known = intervals(values, free, scale, parts)
        doubts = {name: doubt(name, values[name], *known[name]) for name in free}
        new = {name: (why, known[name]) for name, why in doubts.items() if why}
        if not new:
            break
        doubtful, values = doubtful | new, start
    after = _mean_errors(values, parts)
    return Identified(
        estimates=tuple(
            _estimate(name, values[name], start[name], known, doubtful)
            for name in start
        ),
        pushes=sum(len(part.steps) for part in parts),
        before_mm=before[0],
        after_mm=after[0],
        before_deg=before[1],
        after_deg=after[1],
    )


def _tell_of_one_value(store: Store, start: Mapping[str, float]) -> None:
    for name, values in store.read(slice(None), FRICTIONS).items():
        if name in start and np.ptp(values) > 0:
            _log.warning(
                "%s: %s differs from push to push, %.3g to %.3g; one value of it takes "
                "their place, and their mean if the pushes cannot tell one.",
                *(store.path, name, values.min(), values.max()),
            )


def _estimate(
    name: str,
    value: float,
    start: float,
    known: Mapping[str, tuple[float, float]],
    doubtful: Mapping[str, tuple[str, tuple[float, float]]],
) -> Estimate:
    why, interval = doubtful.get(name, (None, known.get(name, BOUNDS[name])))
    return Estimate(name, value, *interval, start, why)


def _raw_errors(values: Mapping[str, float], part: Sample) -> np.ndarray:
    tree = {name: jnp.float32(value) for name, value in values.items()}
    return np.asarray(pose_errors(tree, part.batch, jnp.asarray(part.steps)))


def _scale(values: Mapping[str, float], parts: Sequence[Sample]) -> Scale:
    errors = np.concatenate([_raw_errors(values, p).reshape(-1, 3) for p in parts])
    place = np.sqrt(np.mean(np.sum(errors[:, :2] ** 2, axis=-1)))
    turn = np.sqrt(np.mean(errors[:, 2] ** 2))
    return Scale(float(place) or 1.0, float(turn) or 1.0)


def _mean_errors(
    values: Mapping[str, float], parts: Sequence[Sample]
) -> tuple[float, float]:
    """Return mean errors (mm, degrees) over pushes, where they were observed."""
    errors = [_raw_errors(values, part) for part in parts]
    # Over each push first: of some more poses are looked at than of others.
    place = [np.linalg.norm(e[..., :2], axis=-1).mean(axis=(1, 2)) for e in errors]
    turn = [np.abs(e[..., 2]).mean(axis=(1, 2)) for e in errors]
    return (
        1000 * float(np.concatenate(place).mean()),
        float(np.rad2deg(np.concatenate(turn).mean())),
    )
