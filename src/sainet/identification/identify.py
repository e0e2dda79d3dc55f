"""Estimation of the planar engine's parameters, by gradients through the engine."""

import logging
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from msgspec import UNSET, to_builtins
from scipy.optimize import least_squares

from sainet.datasets.groups import groups_of
from sainet.datasets.store import Store
from sainet.engines.simulator import OwnSpec, SimulatorSpec
from sainet.identification.parameters import (
    FRICTIONS,
    NAMES,
    PLANAR,
    Own,
    bounds_of,
    doubt,
    from_coordinate,
    names_for,
    starting_values,
    to_coordinates,
    to_engine,
)
from sainet.identification.residuals import (
    LEAST_PUSHES,
    Sample,
    Scale,
    intervals,
    pose_errors,
    residuals,
    samples,
    slopes,
)
from sainet.models.card import IDENTIFIED, Estimate, Identified, read_identified
from sainet.runs.digests import digests_to_text
from sainet.runs.documents import write_document
from sainet.runs.errors import BadInput, BadStore
from sainet.runs.folders import open_run

Try = Callable[[float], None]  # called with the root mean square of all errors

_INSIDE = 1e-3  # distance of initial coordinates from the bounds
_WORSE = 0.5  # increase of the loss by values that pushes contradict (fraction)
_Interval = tuple[float, float]


class _Problem(NamedTuple):
    """Pushes that an engine is fitted to."""

    start: dict[str, float]  # initial values
    scale: Scale
    parts: Sequence[Sample]
    on_try: Try

    def solved(self, free: Sequence[str]) -> dict[str, float]:
        """Return all values, with the free parameters at the least-squares solution."""
        if not free:
            return self.start
        bounds, before = bounds_of(free), to_coordinates(self.start)

        def at(vector: np.ndarray) -> dict[str, float]:
            return before | dict(zip(free, vector.tolist(), strict=True))

        def residual(vector: np.ndarray) -> np.ndarray:
            whole = np.concatenate([each.ravel() for each in self._errors(at(vector))])
            self.on_try(float(np.sqrt(np.mean(whole**2))))
            return whole

        def slope(vector: np.ndarray) -> np.ndarray:
            found = (slopes(at(vector), free, self.scale, part) for part in self.parts)
            return np.concatenate([each.reshape(-1, len(free)) for each in found])

        inside = bounds[0] + _INSIDE, bounds[1] - _INSIDE
        solution = least_squares(
            residual,
            np.clip([before[name] for name in free], *inside),
            slope,  # pyright: ignore[reportArgumentType]
            bounds=bounds,
            loss="soft_l1",
            x_scale="jac",
        )
        return {name: from_coordinate(name, x) for name, x in at(solution.x).items()}

    def contradicts(self, values: dict[str, float], best: dict[str, float]) -> bool:
        """Return whether values fit clearly worse, whichever three pushes are left out.

        Args:
            values: of all parameters.
            best: those of a least-squares solution.
        """
        cost, least = (
            np.concatenate([np.sqrt(1 + e**2).sum(axis=1) - e.shape[1] for e in errors])
            for errors in map(self._errors, map(to_coordinates, (values, best)))
        )
        more = np.sort(cost - least)[: 1 - LEAST_PUSHES]
        return bool(more.sum() > _WORSE * least.sum())

    def _errors(self, at: Mapping[str, float]) -> list[np.ndarray]:
        return [residuals(at, self.scale, part) for part in self.parts]


def _estimates(problem: _Problem) -> tuple[Estimate, ...]:
    """Return the estimates of all parameters.

    Doubtful ones keep their initial values, unless the pushes contradict these: where
    none slips, friction may be anything but low.
    """
    start, values = problem.start, problem.solved([*problem.start])
    known, needed = dict[str, _Interval](), set[str]()
    doubtful: dict[str, tuple[str, _Interval]] = {}
    while len(doubtful) < len(start):
        free = [name for name in start if name not in doubtful]
        known = intervals(values, free, problem.scale, problem.parts)
        doubts = {n: doubt(n, values[n], *known[n]) for n in free if n not in needed}
        new = {name: (why, known[name]) for name, why in doubts.items() if why}
        if not new:
            break
        kept = problem.solved([name for name in free if name not in new])
        if not problem.contradicts(kept, values):
            doubtful, values = doubtful | new, kept
            continue
        each = {name: problem.solved([n for n in free if n != name]) for name in new}
        wrong = {name for name in new if problem.contradicts(each[name], values)}
        needed |= wrong or {*new}
    return tuple(
        Estimate(name, value, *interval, start[name], why)
        for name, value in values.items()
        for why, interval in [doubtful.get(name) or (None, known[name])]
    )


_log = logging.getLogger(__name__)


def identify_into(
    store: Store,
    out: Path,
    *,
    simulator: SimulatorSpec = PLANAR,
    on_try: Try = lambda error: None,
) -> Identified:
    """Return the parameters in a run folder, identified there if it is unfinished.

    Args:
        store: see `identify`.
        out: the run folder.
        simulator: see `identify`.
        on_try: see `identify`.

    Raises:
        RunConflict: the folder belongs to another run.
        BadStore: see `identify`.
        BadInput: the folder is finished but damaged.
    """
    settings = {"command": "identify", "data": store.content, "parameters": NAMES}
    if simulator != PLANAR:
        settings["engine"] = to_builtins(simulator)
    check_store(store)
    _own_engine(simulator)  # raises, before there is a folder
    folder = open_run(out, settings, finished_by=IDENTIFIED)
    if not folder.is_finished:
        write_document(out / IDENTIFIED, identify(store, simulator, on_try=on_try))
    return read_identified(out)


def check_store(store: Store) -> None:
    """Raise `BadStore` if no parameter can be identified from these pushes."""
    if not store.read(slice(None), ("pose_observed",))["pose_observed"].any():
        raise BadStore(f"{store.path}: no pose was observed; give observed pushes.")
    if store.info.kind != "robot":
        raise BadStore(
            f"{store.path}: kind is {store.info.kind!r}; parameters are identified "
            "from pushes along paths: give pushes of the robot setup."
        )
    for name, values in store.read(slice(None), FRICTIONS).items():
        if not values.mean() > 0:
            raise BadStore(
                f"{store.path}: {name} is {values.mean():g}; identification starts at "
                "this value, so import or generate the pushes with a positive one."
            )


def identify(
    store: Store, simulator: SimulatorSpec = PLANAR, *, on_try: Try = lambda error: None
) -> Identified:
    """Return estimates of frictions, pressure distribution and camera offset.

    Nonlinear least squares (SciPy, robust against outliers) on the position and
    rotation errors at the observed steps, divided by the initial errors of the engine.
    The 95 % intervals are a bootstrap over pushes, with one Gauss-Newton step for each
    resample; repeats of a push stay together. Parameters that are not identifiable keep
    their initial values, unless the pushes contradict these, and the others are
    estimated again.

    Args:
        store: pushes along paths, with observed final poses at least.
        simulator: planar, or an engine of the user's own, of which frictions and camera
            offset are estimated.
        on_try: called with the root mean square error of each trial solution; about 1
            at the start.

    Raises:
        BadStore: no pose was observed, or forces drive the pusher.
        BadInput: the engine has no derivatives.
    """
    check_store(store)
    parts = samples(store, _own_engine(simulator))
    scenes = [part.batch.scene for part in parts]
    start = starting_values(scenes, names_for(scenes[0], simulator))
    _tell_of_one_value(store, start)
    before, scale = _mean_errors(start, parts), _scale(start, parts)
    estimates = _estimates(_Problem(start, scale, parts, on_try))
    values = {each.name: each.value for each in estimates}
    after = _mean_errors(values, parts)
    return Identified(
        engine=to_engine(values, simulator),
        estimates=estimates,
        pushes=sum(len(part.steps) for part in parts),
        before_mm=before[0],
        after_mm=after[0],
        before_deg=before[1],
        after_deg=after[1],
        digests=digests_to_text(store.push_hashes()),
        groups=groups_of([store]) or UNSET,
    )


def _own_engine(simulator: SimulatorSpec) -> Own:
    """Return an engine of the user's own; None for the planar engine."""
    if simulator.engine == PLANAR.engine:
        return None
    if not isinstance(simulator, OwnSpec):
        raise BadInput(
            f"`engine` is {simulator.engine}, which has no derivatives, so that no "
            "parameter can be identified; use planar, or an engine of your own."
        )
    return simulator.build().engine


def _tell_of_one_value(store: Store, start: Mapping[str, float]) -> None:
    for name, values in store.read(slice(None), FRICTIONS).items():
        if name in start and np.ptp(values) > 0:
            _log.warning(
                "%s: %s varies between pushes, %.3g to %.3g; one estimate replaces "
                "these values, or their mean if it is not identifiable.",
                *(store.path, name, values.min(), values.max()),
            )


def _raw_errors(values: Mapping[str, float], part: Sample) -> np.ndarray:
    tree = {name: jnp.float32(value) for name, value in values.items()}
    return np.asarray(pose_errors(tree, *part.inputs))[: len(part.steps)]


def _scale(values: Mapping[str, float], parts: Sequence[Sample]) -> Scale:
    errors = np.concatenate([_raw_errors(values, p).reshape(-1, 3) for p in parts])
    place = np.sqrt(np.mean(np.sum(errors[:, :2] ** 2, axis=-1)))
    turn = np.sqrt(np.mean(errors[:, 2] ** 2))
    return Scale(float(place) or 1.0, float(turn) or 1.0)


def _mean_errors(
    values: Mapping[str, float], parts: Sequence[Sample]
) -> tuple[float, float]:
    """Return mean errors (mm, degrees) over the observed steps of all pushes."""
    errors = [_raw_errors(values, part) for part in parts]
    # Average over each push first, because pushes differ in their observed steps.
    place = [np.linalg.norm(e[..., :2], axis=-1).mean(axis=(1, 2)) for e in errors]
    turn = [np.abs(e[..., 2]).mean(axis=(1, 2)) for e in errors]
    m, rad = (np.concatenate(each).mean() for each in (place, turn))
    return 1000 * float(m), float(np.rad2deg(rad))
