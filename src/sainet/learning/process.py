"""Fitting a Gaussian process to what an engine gets wrong, and calibrating it."""

import functools
import logging
from collections.abc import Callable
from pathlib import Path
from typing import Any

import jax
import msgspec
import numpy as np
from jaxtyping import Float
from scipy.linalg import solve_triangular
from scipy.optimize import minimize

from sainet.datasets.groups import groups_of
from sainet.datasets.splits import fold_of_push
from sainet.datasets.store import Store
from sainet.engines.simulator import InternalEngine
from sainet.learning.process_ends import Ends, ends_of
from sainet.models.checkpoint import save_arrays
from sainet.models.correctors import CONFIDENCE
from sainet.models.correctors.process import (
    BODIES,
    RESIDUALS,
)
from sainet.models.identity import ModelId
from sainet.models.process_card import (
    ARRAYS,
    MOST,
    PROCESS,
    Fitted,
    ProcessCard,
    ProcessSettings,
    rates_at,
    squared_distances,
)
from sainet.runs.digests import digests_to_text
from sainet.runs.documents import content_hash, read_document, write_document
from sainet.runs.errors import BadStore
from sainet.runs.folders import open_run
from sainet.runs.interrupts import raise_if_interrupted
from sainet.runs.manifest import MANIFEST, Manifest

_ENOUGH = 1000  # pushes for amplitude, length scales and noise; the rest conditions
_FAR = 4.0  # standard deviations, outputs beyond are cut: failed recordings
# Normal prior of the logarithms: amplitude, noise (of standardised outputs), lengths
# (of standardised inputs), and bounds.
_PRIOR = {"amplitude": 0.0, "noise": -0.7, "length": 1.0}
_PRIOR_WIDTH = 1.5
_BOUNDS = {"amplitude": (-4.0, 4.0), "noise": (-4.0, 4.0), "length": (-3.0, 5.0)}
Identify = Callable[[Path], InternalEngine]
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
        BadStore: the pushes do not suffice, or forces drive the pusher.
        BadInput: an input that was asked for is the same in all pushes.
        RunConflict: the folder contains something else.
    """
    check_store(store, settings)
    given = "identified" if callable(internal) else msgspec.to_builtins(internal)
    config = {"command": "tune", "model": "gp", "internal_engine": given}
    config |= {"data": store.content, **msgspec.to_builtins(settings)}
    folder = open_run(out, config, finished_by=PROCESS)
    if folder.is_finished:
        _log.info("%s is already finished", out)
        return
    if callable(internal):
        internal = internal(out / ENGINE)
    ends = ends_of(store, internal, settings.features)
    fitted, loss = fit_to(ends, settings, on_output)
    arrays = _calibrate(ends, fitted, settings, on_output)
    with jax.enable_x64(True):
        data = save_arrays(out / ARRAYS, arrays)
    info = store.info
    card = ProcessCard(
        identity=ModelId(
            kind="gp", simulator=internal.simulator, features=settings.features
        ),
        kind="robot",
        time_step=info.time_step,
        truth_engine=info.engine,
        camera=internal.camera,
        data=store.content,
        disks=info.bodies,
        trained_pushes=len(ends.travel),
        pushes=digests_to_text(store.push_hashes()),
        groups=groups_of([store]),
        weights=content_hash(data),
        inputs=ends.names,
        recipe=settings,
        manifest=read_document(out / MANIFEST, Manifest),
        final_loss=loss,
    )
    write_document(out / PROCESS, card)


def fits_of(store: Store, settings: ProcessSettings) -> int:
    """Return how often `fit_process` calls `on_output`."""
    return RESIDUALS * store.info.bodies * (1 + settings.folds)


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
            f"{path}: pushes of {info.bodies} disks; the inputs of a Gaussian process "
            "describe one or two, train a network."
        )
    if info.pushes > MOST:
        raise BadStore(
            f"{path}: {info.pushes} pushes; a Gaussian process takes at most {MOST}, "
            "choose some with `pushes`."
        )
    kinds = len(np.unique(store.repeats()))
    if kinds < settings.folds:
        raise BadStore(
            f"{path}: {kinds} pushes that are not repeats of each other; the "
            f"calibration needs at least {settings.folds}."
        )


def fit_to(
    ends: Ends,
    settings: ProcessSettings,
    on_output: Callable[[], None] = lambda: None,
    begin: np.ndarray | None = None,
) -> tuple[Fitted, float]:
    """Return the most probable process, and its mean loss for push and output.

    Args:
        ends: of the pushes.
        settings: of the fit.
        on_output: called after each output.
        begin: logarithms of amplitude, noise and lengths of each output, from which a
            fit to other pushes takes a quarter of the iterations.
    """
    centre, width = ends.inputs.mean(axis=0), ends.inputs.std(axis=0)
    width = np.where(width > 0, width, 1.0)
    inputs = (ends.inputs - centre) / width
    mean, scale = ends.rates.mean(axis=0), ends.rates.std(axis=0)
    scale = np.where(scale > 0, scale, 1.0)
    outputs = np.clip((ends.rates - mean) / scale, -_FAR, _FAR).T
    some = np.random.default_rng(settings.seed).permutation(len(inputs))[:_ENOUGH]
    found, losses = [], []
    for output, values in enumerate(outputs):
        raise_if_interrupted()
        at = None if begin is None else begin[output]
        most = settings.iterations if begin is None else 1 + settings.iterations // 4
        best = _most_probable(inputs[some], values[some], most, at)
        found.append(np.exp(best[0]))
        losses.append(best[1] / len(some))
        on_output()
    parameters = np.stack(found)
    fitted = Fitted(
        inputs=inputs,
        outputs=outputs,
        amplitude=parameters[:, 0],
        length=parameters[:, 2:],
        noise=parameters[:, 1] ** 2,
        mean=mean,
        scale=scale,
        centre=centre,
        width=width,
        reach=np.ones((len(outputs) // RESIDUALS, 2)),
        plain=np.ones((len(outputs) // RESIDUALS, 2)),
    )
    return fitted, float(np.mean(losses))


def _most_probable(
    inputs: np.ndarray, values: np.ndarray, most: int, begin: np.ndarray | None
) -> tuple[Float[np.ndarray, " parameter"], float]:
    """Return the logarithms of amplitude, noise and lengths, and their loss."""
    names = ["amplitude", "noise", *["length"] * inputs.shape[1]]
    prior = np.array([_PRIOR[name] for name in names])

    found: Any = minimize(
        functools.partial(_loss_and_slope, inputs=inputs, values=values, prior=prior),
        prior if begin is None else begin,
        jac=True,
        method="L-BFGS-B",
        bounds=[_BOUNDS[name] for name in names],
        options={"maxiter": most},
    )
    return found.x, float(found.fun)


def _loss_and_slope(
    at: np.ndarray, inputs: np.ndarray, values: np.ndarray, prior: np.ndarray
) -> tuple[float, np.ndarray]:
    """Return the negative log density of values and parameters, and its gradient.

    Rasmussen and Williams (2006), eq. 5.8 and 5.9, with the `covariance` of the model.
    """
    scaled, noise = inputs / np.exp(at[2:]), np.exp(2 * at[1])
    far = np.sqrt(3 * squared_distances(scaled, scaled))
    faded = np.exp(2 * at[0] - far)
    signal = (1 + far) * faded
    factor = np.linalg.cholesky(signal + noise * np.eye(len(values)))
    half = solve_triangular(factor, np.eye(len(values)), lower=True)
    inverse = half.T @ half
    weights = inverse @ values
    steep = inverse - np.outer(weights, weights)  # twice the slope in the covariance
    bent = 3 * steep * faded
    # Sums of `bent` times the squared differences of each input.
    squares = bent.sum(axis=0) @ scaled**2 - np.sum(scaled * (bent @ scaled), axis=0)
    slope = np.array([np.sum(steep * signal), noise * np.trace(steep), *squares])
    off = (at - prior) / _PRIOR_WIDTH
    size = values @ weights + len(values) * np.log(2 * np.pi) + off @ off
    return size / 2 + np.sum(np.log(np.diag(factor))), slope + off / _PRIOR_WIDTH


def _calibrate(
    ends: Ends,
    fitted: Fitted,
    settings: ProcessSettings,
    on_output: Callable[[], None],
) -> Fitted:
    """Return the process with the factors of deviations that make 90 % regions.

    Conformal prediction over folds: whole kinds of push are left out of the fit that
    predicts them. Its optimiser begins at the parameters of the whole fit. `plain` is
    the same for regions of one size everywhere.
    """
    owner = fold_of_push(ends.kinds, settings.folds, settings.seed)
    noise = np.sqrt(fitted.noise)
    begin = np.log(np.column_stack([fitted.amplitude, noise, fitted.length]))
    scores, plain = [], []
    for fold in range(settings.folds):
        others, held = ends.take(owner != fold), ends.take(owner == fold)
        part, _ = fit_to(others, settings, on_output, begin)
        mean, deviation = rates_at(part, held.inputs)
        off = held.rates - mean
        scores.append(_sizes(off / deviation))
        plain.append(_sizes(off))
    return fitted._replace(
        reach=quantile(np.concatenate(scores)), plain=quantile(np.concatenate(plain))
    )


def _sizes(off: Float[np.ndarray, "push output"]) -> Float[np.ndarray, "push body 2"]:
    """Return the sizes of errors of position and of rotation."""
    off = off.reshape(len(off), -1, RESIDUALS)
    return np.stack([np.hypot(off[..., 0], off[..., 1]), np.abs(off[..., 2])], axis=-1)


def quantile(scores: Float[np.ndarray, "push body 2"]) -> Float[np.ndarray, "body 2"]:
    """Return the conformal quantile, below which `CONFIDENCE` of new scores lie."""
    count = len(scores)
    rank = min(count, int(np.ceil(CONFIDENCE * (count + 1))))
    return np.sort(scores, axis=0)[rank - 1]
