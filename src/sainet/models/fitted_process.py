"""Fitted Gaussian processes: their arrays, in double precision, and predictions."""

from pathlib import Path

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float
from scipy.linalg import cho_solve, cholesky, solve_triangular

from sainet.models.checkpoint import load_arrays
from sainet.models.correctors.kernels import KERNELS, KernelName
from sainet.models.correctors.process import RESIDUALS, Inputs, Process, ResidualProcess
from sainet.models.process_card import ARRAYS, REMEDY, ProcessCard, read_process_card


class Fitted(eqx.Module):
    """The arrays of a process, in double precision; `Process` has their meanings."""

    inputs: Float[np.ndarray, "push input"]  # standardised
    outputs: Float[np.ndarray, "output push"]  # standardised
    amplitude: Float[np.ndarray, " output"]
    length: Float[np.ndarray, "output input"]
    noise: Float[np.ndarray, " output"]
    mean: Float[np.ndarray, " output"]
    scale: Float[np.ndarray, " output"]
    share: Float[np.ndarray, " output"]  # of the residual, from 0 to 1, that is added
    centre: Float[np.ndarray, " input"]
    width: Float[np.ndarray, " input"]
    errors: Float[np.ndarray, "push body 2"]
    near: Float[np.ndarray, "body 2 input"]
    reach: Float[np.ndarray, "body 2"]
    plain: Float[np.ndarray, "body 2"]
    kernel: KernelName = eqx.field(static=True, default="matern-3/2")


def corrector_of(
    fitted: Fitted, inputs: tuple[str, ...], time_step: float
) -> ResidualProcess:
    """Return the process given its pushes, solved in double precision."""
    weights, whitening = [], []
    for output, values in enumerate(fitted.outputs):
        covariance = covariance_of(fitted, output)
        factor = cholesky(covariance, lower=True)
        weights.append(fitted.share[output] * cho_solve((factor, True), values))
        unit = np.eye(len(values))
        whitening.append(solve_triangular(factor, unit, lower=True))

    def single(value: np.ndarray) -> jax.Array:
        return jnp.asarray(value, jnp.float32)

    same = ("inputs", "amplitude", "length", "noise", "scale")
    process = Process(
        mean=single(fitted.share * fitted.mean),
        weights=single(np.stack(weights)),
        whitening=single(np.stack(whitening)),
        kernel=fitted.kernel,
        **{name: single(getattr(fitted, name)) for name in same},
    )
    same = ("centre", "width", "errors", "near", "reach", "plain")
    return ResidualProcess(
        process,
        inputs=Inputs(inputs),
        time_step=time_step,
        **{name: single(getattr(fitted, name)) for name in same},
    )


def covariance_of(fitted: Fitted, output: int) -> Float[np.ndarray, "push push"]:
    """Return the covariance of an output at its pushes, noise included."""
    found = covariance_between(fitted, output, fitted.inputs, fitted.inputs)
    return found + fitted.noise[output] * np.eye(len(found))


def covariance_between(
    fitted: Fitted,
    output: int,
    one: Float[np.ndarray, "one input"],
    other: Float[np.ndarray, "other input"],
) -> Float[np.ndarray, "one other"]:
    """Return the prior covariance of an output at standardised inputs, no noise."""
    length = fitted.length[output]
    near = correlation_between(fitted.kernel, one / length, other / length)
    return fitted.amplitude[output] ** 2 * near


def correlation_between(
    kernel: KernelName,
    one: Float[np.ndarray, "one input"],
    other: Float[np.ndarray, "other input"],
) -> Float[np.ndarray, "one other"]:
    """Return the prior correlation of points whose length scales are 1."""
    factor, of = KERNELS[kernel]
    return of(np.sqrt(factor * squared_distances(one, other)), np.exp)[0]


def squared_distances(
    one: Float[np.ndarray, "one input"], other: Float[np.ndarray, "other input"]
) -> Float[np.ndarray, "one other"]:
    """Return the squared distances of points, by one product of matrices."""
    sizes = np.add.outer(np.sum(one**2, axis=1), np.sum(other**2, axis=1))
    return np.maximum(sizes - 2 * one @ other.T, 0.0)


def rates_at(
    fitted: Fitted, inputs: Float[np.ndarray, "push input"]
) -> tuple[Float[np.ndarray, "push output"], Float[np.ndarray, "push output"]]:
    """Return the residuals to add and their deviations, as `ResidualProcess.rates`.

    In double precision and without compilation, which fits to few pushes would spend
    most of their time on.
    """
    points = (inputs - fitted.centre) / fitted.width
    means, deviations = np.empty((2, len(points), len(fitted.outputs)))
    for output, values in enumerate(fitted.outputs):
        factor = cholesky(covariance_of(fitted, output), lower=True)
        across = covariance_between(fitted, output, fitted.inputs, points)
        white = solve_triangular(factor, across, lower=True)
        left = fitted.amplitude[output] ** 2 - np.sum(white**2, axis=0)
        deviations[:, output] = np.sqrt(np.maximum(left, 0) + fitted.noise[output])
        means[:, output] = across.T @ cho_solve((factor, True), values)
    means = fitted.share * (fitted.mean + fitted.scale * means)
    return means, fitted.scale * deviations


def load_process(folder: Path) -> tuple[ResidualProcess, ProcessCard]:
    """Read a Gaussian process and its card.

    Raises:
        BadCheckpoint: damaged, of another format, or the two do not fit.
    """
    fitted, card = read_process(folder)
    return corrector_of(fitted, card.inputs, card.time_step), card


def read_process(folder: Path) -> tuple[Fitted, ProcessCard]:
    """Read the arrays of a Gaussian process and its card.

    Raises:
        BadCheckpoint: damaged, of another format, or the two do not fit.
    """
    card = read_process_card(folder)
    pushes, inputs = card.trained_pushes, len(card.inputs)
    outputs = RESIDUALS * card.disks
    like = Fitted(
        inputs=np.empty((pushes, inputs)),
        outputs=np.empty((outputs, pushes)),
        amplitude=np.empty(outputs),
        length=np.empty((outputs, inputs)),
        noise=np.empty(outputs),
        mean=np.empty(outputs),
        scale=np.empty(outputs),
        share=np.empty(outputs),
        centre=np.empty(inputs),
        width=np.empty(inputs),
        errors=np.empty((pushes, card.disks, 2)),
        near=np.empty((card.disks, 2, inputs)),
        reach=np.empty((card.disks, 2)),
        plain=np.empty((card.disks, 2)),
        kernel=card.recipe.kernel,
    )
    with jax.enable_x64(True):
        arrays = load_arrays(folder / ARRAYS, like, REMEDY, known=card.weights)
    return jax.tree.map(np.asarray, arrays), card
