"""Fitting a Gaussian process to what an engine gets wrong, and calibrating it."""

import logging
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import jax
import msgspec
import numpy as np
from jaxtyping import Float, Int

from sainet.datasets.groups import groups_of
from sainet.datasets.splits import fold_of_push
from sainet.datasets.store import Store
from sainet.engines.simulator import InternalEngine
from sainet.learning.process_ends import Ends, ends_of, known_ends
from sainet.learning.process_fit import fit_to
from sainet.models.checkpoint import save_arrays
from sainet.models.correctors import CONFIDENCE, interval_score
from sainet.models.correctors.process import BODIES, RESIDUALS, error_near
from sainet.models.fitted_process import Fitted, correlation_between, rates_at
from sainet.models.identity import ModelId
from sainet.models.process_card import (
    ARRAYS,
    MOST,
    PROCESS,
    ProcessCard,
    ProcessSettings,
)
from sainet.runs.digests import digests_to_text
from sainet.runs.documents import content_hash, read_document, write_document
from sainet.runs.errors import BadStore
from sainet.runs.folders import open_run
from sainet.runs.manifest import MANIFEST, Manifest

Identify = Callable[[Path], InternalEngine]
# Widths of neighbourhoods, in length scales; in the last one all pushes count alike.
_NEAR = (0.35, 0.5, 0.7, 1.0, 1.5, 1e6)
_TINY = 1e-30  # less than any size or sum of squares but zero
ENGINE = "engine"  # folder, inside the run folder, of the engine identified for it
_log = logging.getLogger(__name__)


def fit_process(
    store: Store,
    out: Path,
    internal: InternalEngine | Identify,
    settings: ProcessSettings,
    *,
    on_output: Callable[[], None] = lambda: None,
) -> None:
    """Fit a Gaussian process to the residuals of an engine; an identical call does not.

    Args:
        store: pushes along paths, of one or two disks, observed at their ends.
        out: the run folder.
        internal: the engine whose residuals are learned, or a function that identifies
            it on the same pushes, in the folder that it is given.
        settings: features, and how to fit.
        on_output: called after each fit of one output, `fits_of` times.

    Raises:
        BadStore: the pushes do not suffice, forces drive the pusher, or an input that
            was asked for is the same in all pushes.
        RunConflict: the folder contains something else.
    """
    check_store(store, settings)
    given = "identified" if callable(internal) else internal.settings
    config = {"command": "tune", "model": "gp", "internal_engine": given}
    config |= {"data": store.content, **msgspec.to_builtins(settings)}
    folder = open_run(out, config, finished_by=PROCESS)
    if folder.is_finished:
        _log.info("%s is already finished", out)
        return
    if callable(internal):
        internal = internal(out / ENGINE)
    ends = ends_of(store, internal, settings.features)
    best = _best_fit(ends, settings, on_output)
    with jax.enable_x64(True):
        data = save_arrays(out / ARRAYS, best.fitted)
    info = store.info
    card = ProcessCard(
        identity=ModelId(
            kind="gp", simulator=internal.simulator, features=best.settings.features
        ),
        kind="robot",
        time_step=info.time_step,
        truth_engine=info.engine,
        camera=internal.camera,
        data=store.content,
        disks=info.bodies,
        trained_pushes=len(ends.travel),
        pushes=digests_to_text(store.push_hashes(), internal.pushes or ""),
        groups=groups_of([store]),
        weights=content_hash(data),
        inputs=best.names,
        recipe=best.settings,
        manifest=read_document(out / MANIFEST, Manifest),
        final_loss=best.loss,
    )
    write_document(out / PROCESS, card)


def fits_of(store: Store, settings: ProcessSettings) -> int:
    """Return how often `fit_process` calls `on_output`."""
    return RESIDUALS * store.info.bodies * (1 + settings.folds) * len(settings.options)


def check_store(store: Store, settings: ProcessSettings) -> None:
    """Raise `BadStore` if a process cannot be fitted to these pushes."""
    info, path = store.info, store.path
    if info.kind != "robot":
        raise BadStore(
            f"{path}: kind is {info.kind!r}; a Gaussian process needs the path of the "
            "pusher, give pushes of the robot setup."
        )
    if info.bodies > BODIES:
        raise BadStore(
            f"{path}: {info.bodies} disks; a Gaussian process takes one or two, train "
            "a network (to cross-validate, give `models` sain sain-place)."
        )
    if info.pushes > MOST:
        raise BadStore(
            f"{path}: {info.pushes} pushes; a Gaussian process takes at most {MOST}, "
            "choose some with `pushes`."
        )
    found = len(np.unique(known_ends(store, settings.features).kinds))
    if found < settings.folds:
        raise BadStore(
            f"{path}: {found} pushes that are not repeats of each other and have known "
            f"ends; the calibration needs at least {settings.folds}."
        )


class _Fit(NamedTuple):
    """A calibrated process, and how well it predicts pushes left out of its fit."""

    settings: ProcessSettings
    names: tuple[str, ...]  # of its inputs
    fitted: Fitted
    loss: float
    missed: float  # mean error on pushes left out, as a fraction of the residuals


def _best_fit(
    ends: Ends, settings: ProcessSettings, on_output: Callable[[], None]
) -> _Fit:
    """Return the fit, of the options, that predicts pushes left out of it best."""
    fits = [
        calibrated_fit(ends.with_features(each.features), each, on_output)
        for each in settings.options
    ]
    return min(fits, key=lambda fit: fit.missed)


def calibrated_fit(
    ends: Ends, settings: ProcessSettings, on_output: Callable[[], None] = lambda: None
) -> _Fit:
    """Fit a process, the share of it to add, and what makes 90 % regions.

    All follow from predictions over folds: whole kinds of push are left out of the fit
    that predicts them. Its optimiser begins at the parameters of the whole fit. `plain`
    is for regions of one size everywhere.
    """
    fitted, loss = fit_to(ends, settings, on_output)
    owner = fold_of_push(ends.kinds, settings.folds, settings.seed)
    noise = np.sqrt(fitted.noise)
    begin = np.log(np.column_stack([fitted.amplitude, noise, fitted.length]))
    mean, deviation = np.empty_like(ends.rates), np.empty_like(ends.rates)
    for fold in range(settings.folds):
        held = owner == fold
        part, _ = fit_to(ends.take(~held), settings, on_output, begin)
        mean[held], deviation[held] = rates_at(part, ends.inputs[held])
    share = share_of(mean, ends.rates)
    off = ends.rates - share * mean
    missed, errors = sizes_of(off), sizes_of(off / deviation)
    near, reach = _neighbourhoods(fitted, errors, _areas(deviation), owner)
    calibrated = replace(
        fitted,
        share=share,
        errors=errors,
        near=near,
        reach=reach,
        plain=quantile(missed),
    )
    left = missed.mean(axis=0) / np.maximum(sizes_of(ends.rates).mean(axis=0), _TINY)
    return _Fit(settings, ends.names, calibrated, loss, float(left.mean()))


def share_of(
    predicted: Float[np.ndarray, "push output"], rates: Float[np.ndarray, "push output"]
) -> Float[np.ndarray, " output"]:
    """Return the share of predictions, from 0 to 1, with the smallest squared errors.

    One for the position of a body and one for its rotation. From few pushes a process
    learns residuals that are not there; the share says how much of them to add.
    """
    bodies = rates.shape[1] // RESIDUALS
    first = np.add.outer(RESIDUALS * np.arange(bodies), [0, 2]).ravel()
    products, squares = (
        np.add.reduceat(np.sum(predicted * other, axis=0), first)
        for other in (rates, predicted)
    )
    best = np.clip(products / np.maximum(squares, _TINY), 0.0, 1.0)
    return np.repeat(best, [2, 1] * bodies)


def sizes_of(
    off: Float[np.ndarray, "push *output"],
) -> Float[np.ndarray, "push body 2"]:
    """Return the sizes of errors of position and of rotation."""
    off = off.reshape(len(off), -1, RESIDUALS)
    return np.stack([np.hypot(off[..., 0], off[..., 1]), np.abs(off[..., 2])], axis=-1)


def _areas(
    deviation: Float[np.ndarray, "push output"],
) -> Float[np.ndarray, "push body 2"]:
    """Return the radius of the circle of an ellipse's area, and the half width."""
    each = deviation.reshape(len(deviation), -1, RESIDUALS)
    return np.stack([np.sqrt(each[..., 0] * each[..., 1]), each[..., 2]], axis=-1)


def _neighbourhoods(
    fitted: Fitted,
    errors: Float[np.ndarray, "push body 2"],
    sizes: Float[np.ndarray, "push body 2"],
    owner: Int[np.ndarray, " push"],
) -> tuple[Float[np.ndarray, "body 2 input"], Float[np.ndarray, "body 2"]]:
    """Return the length scales of neighbourhoods, and the factors of regions.

    The error of a push is expected to be the mean error of the pushes near it, of other
    folds. Of several widths, that with the smallest mean interval score is taken.

    Args:
        fitted: the process.
        errors: on pushes left out of a fit, in standard deviations.
        sizes: of one standard deviation, for each metre of travel.
        owner: fold of each push.
    """
    lengths = fitted.length.reshape(-1, RESIDUALS, fitted.length.shape[1])
    lengths = np.stack([np.sqrt(lengths[:, 0] * lengths[:, 1]), lengths[:, 2]], axis=1)
    near, reach = np.empty_like(lengths), np.empty(lengths.shape[:2])
    apart = owner[:, None] != owner[None]
    for place in np.ndindex(reach.shape):
        found, size = errors[:, *place], sizes[:, *place]
        best = np.inf
        for length in np.multiply.outer(_NEAR, lengths[place]):
            points = fitted.inputs / length
            close = correlation_between(fitted.kernel, points, points)
            expected = np.maximum(error_near(found, close * apart), _TINY)
            (factor,) = quantile((found / expected)[:, None])
            score = interval_score(factor * expected * size, found * size).mean()
            if score < best:
                best, reach[place], near[place] = score, factor, length
    return near, reach


def quantile(scores: Float[np.ndarray, "push *rest"]) -> Float[np.ndarray, "*rest"]:
    """Return the conformal quantile, below which `CONFIDENCE` of new scores lie."""
    count = len(scores)
    rank = min(count, int(np.ceil(CONFIDENCE * (count + 1))))
    return np.sort(scores, axis=0)[rank - 1]
