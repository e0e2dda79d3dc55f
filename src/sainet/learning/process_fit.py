"""The most probable Gaussian process of the residuals of an engine."""

import functools
from collections.abc import Callable
from typing import Any

import numpy as np
from jaxtyping import Float
from scipy.linalg import solve_triangular
from scipy.optimize import minimize

from sainet.learning.process_ends import Ends
from sainet.models.correctors.kernels import KERNELS, KernelName
from sainet.models.correctors.process import RESIDUALS
from sainet.models.fitted_process import Fitted, squared_distances
from sainet.models.process_card import ProcessSettings
from sainet.runs.interrupts import raise_if_interrupted

_ENOUGH = 1000  # pushes for amplitude, length scales and noise; the rest conditions
_FAR = 4.0  # standard deviations, outputs beyond are cut: failed recordings
# Normal prior of the logarithms: amplitude, noise (of standardised outputs), lengths
# (of standardised inputs), and bounds.
_PRIOR = {"amplitude": 0.0, "noise": -0.7, "length": 1.0}
_PRIOR_WIDTH = 1.5
_BOUNDS = {"amplitude": (-4.0, 4.0), "noise": (-4.0, 4.0), "length": (-3.0, 5.0)}


def fit_to(
    ends: Ends,
    settings: ProcessSettings,
    on_output: Callable[[], None] = lambda: None,
    begin: np.ndarray | None = None,
) -> tuple[Fitted, float]:
    """Return the most probable process, and its mean loss for push and output.

    Args:
        ends: of the pushes; all of their inputs are used.
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
        given = inputs[some], values[some], settings.kernel
        best = _most_probable(*given, most, at)
        found.append(np.exp(best[0]))
        losses.append(best[1] / len(some))
        on_output()
    parameters, bodies = np.stack(found), len(outputs) // RESIDUALS
    fitted = Fitted(
        inputs=inputs,
        outputs=outputs,
        amplitude=parameters[:, 0],
        length=parameters[:, 2:],
        noise=parameters[:, 1] ** 2,
        mean=mean,
        scale=scale,
        share=np.ones(len(outputs)),
        centre=centre,
        width=width,
        errors=np.ones((len(inputs), bodies, 2)),
        near=np.ones((bodies, 2, inputs.shape[1])),
        reach=np.ones((bodies, 2)),
        plain=np.ones((bodies, 2)),
        kernel=settings.kernel,
    )
    return fitted, float(np.mean(losses))


def _most_probable(
    inputs: np.ndarray,
    values: np.ndarray,
    kernel: KernelName,
    most: int,
    begin: np.ndarray | None,
) -> tuple[Float[np.ndarray, " parameter"], float]:
    """Return the logarithms of amplitude, noise and lengths, and their loss."""
    names = ["amplitude", "noise", *["length"] * inputs.shape[1]]
    prior = np.array([_PRIOR[name] for name in names])

    found: Any = minimize(
        functools.partial(
            loss_and_slope, inputs=inputs, values=values, kernel=kernel, prior=prior
        ),
        prior if begin is None else begin,
        jac=True,
        method="L-BFGS-B",
        bounds=[_BOUNDS[name] for name in names],
        options={"maxiter": most},
    )
    return found.x, float(found.fun)


def loss_and_slope(
    at: np.ndarray,
    inputs: np.ndarray,
    values: np.ndarray,
    kernel: KernelName,
    prior: np.ndarray,
) -> tuple[float, np.ndarray]:
    """Return the negative log density of values and parameters, and its gradient.

    Rasmussen and Williams (2006), eq. 5.8 and 5.9, with the `covariance` of the model.
    """
    scaled, noise = inputs / np.exp(at[2:]), np.exp(2 * at[1])
    factor, of = KERNELS[kernel]
    far = np.sqrt(factor * squared_distances(scaled, scaled))
    signal, fall = (np.exp(2 * at[0]) * each for each in of(far, np.exp))
    root = np.linalg.cholesky(signal + noise * np.eye(len(values)))
    half = solve_triangular(root, np.eye(len(values)), lower=True)
    inverse = half.T @ half
    weights = inverse @ values
    steep = inverse - np.outer(weights, weights)  # twice the slope in the covariance
    bent = steep * fall
    # Sums of `bent` times the squared differences of each input.
    squares = bent.sum(axis=0) @ scaled**2 - np.sum(scaled * (bent @ scaled), axis=0)
    slope = np.array([np.sum(steep * signal), noise * np.trace(steep), *squares])
    off = (at - prior) / _PRIOR_WIDTH
    size = values @ weights + len(values) * np.log(2 * np.pi) + off @ off
    return size / 2 + np.sum(np.log(np.diag(root))), slope + off / _PRIOR_WIDTH
