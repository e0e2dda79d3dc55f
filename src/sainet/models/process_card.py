"""Gaussian processes on disk: their card, and their arrays in a file of their own."""

from pathlib import Path
from typing import Annotated, ClassVar, Literal, get_args

import equinox as eqx
import jax
import jax.numpy as jnp
import msgspec
import numpy as np
from jaxtyping import Float
from scipy.linalg import cho_solve, cholesky, solve_triangular

from sainet.engines.simulator import InternalEngine
from sainet.models.card import Count
from sainet.models.checkpoint import load_arrays
from sainet.models.correctors.kernels import KERNELS, KernelName
from sainet.models.correctors.process import (
    BODIES,
    RESIDUALS,
    Inputs,
    Process,
    ResidualProcess,
)
from sainet.models.identity import ModelId, ProcessFeatures
from sainet.runs.documents import read_document
from sainet.runs.errors import BadCheckpoint
from sainet.runs.manifest import Manifest
from sainet.scenes.quantities import TimeStep
from sainet.scenes.recording import AGREES, CameraOffset

PROCESS = "process.json"
ARRAYS = "process.safetensors"
_REMEDY = "fit it again"
MOST = 5000  # pushes of one process: its covariance is a dense matrix
Name = Annotated[str, msgspec.Meta(pattern=r"\A[a-z_0-9]{1,40}\Z")]


class ProcessSettings(msgspec.Struct, frozen=True, kw_only=True):
    """How a process was fitted."""

    features: ProcessFeatures = "side"
    kernel: KernelName = "matern-3/2"
    # Whether kernel and features were chosen, of all kernels and of features up to
    # those that were allowed.
    choose: bool = False
    iterations: Count = 50  # of the optimiser, at most, for each output
    seed: Annotated[int, msgspec.Meta(ge=0)] = 0
    folds: Annotated[int, msgspec.Meta(ge=2)] = 5  # that calibrate its uncertainty

    @property
    def options(self) -> tuple["ProcessSettings", ...]:
        """All settings to choose from; without a choice, only these."""
        if not self.choose:
            return (self,)
        return tuple(
            msgspec.structs.replace(self, features=features, kernel=kernel)
            for features in up_to(self.features)
            for kernel in KERNELS
        )


def up_to(features: ProcessFeatures) -> tuple[ProcessFeatures, ...]:
    """Return features and all those with fewer inputs, from the fewest."""
    every: tuple[ProcessFeatures, ...] = get_args(ProcessFeatures)
    return every[: every.index(features) + 1]


class ProcessCard(msgspec.Struct, frozen=True, kw_only=True):
    """Metadata that restricts a process's use; fields of `Card` mean the same."""

    file: ClassVar[str] = PROCESS
    noun: ClassVar[str] = "Gaussian process"
    made: ClassVar[str] = "trained"

    identity: ModelId
    kind: Literal["robot"]
    time_step: TimeStep  # s
    truth_engine: str
    camera: CameraOffset = AGREES
    data: str
    disks: Annotated[int, msgspec.Meta(ge=1, le=BODIES)]
    trained_pushes: Annotated[int, msgspec.Meta(ge=1, le=MOST)]
    data_seeds: tuple[int, ...] = ()
    pushes: str = ""
    groups: tuple[str, ...] = ()
    weights: str  # hash of the arrays' file
    inputs: Annotated[tuple[Name, ...], msgspec.Meta(min_length=1, max_length=20)]
    recipe: ProcessSettings
    manifest: Manifest
    final_loss: float  # negative log likelihood for each push and output
    seal: str = ""  # hash of all other fields
    format_version: Literal[1] = 1

    def __post_init__(self) -> None:
        """Refuse identities that no process can have."""
        if self.identity.kind != "gp" or self.identity.simulator is None:
            raise ValueError("identity is not that of a Gaussian process")

    @property
    def numbers_of_disks(self) -> tuple[int, ...]:
        """The number of disks in the pushes of the training data."""
        return (self.disks,)

    @property
    def has_single_steps(self) -> bool:
        """False: a process predicts whole pushes."""
        return False

    @property
    def internal(self) -> InternalEngine | None:
        """The internal engine."""
        simulator = self.identity.simulator
        return None if simulator is None else InternalEngine(simulator, self.camera)


class Fitted(eqx.Module):
    """The arrays of a process, in double precision; `Process` has their meanings."""

    inputs: Float[np.ndarray, "push input"]  # standardised
    outputs: Float[np.ndarray, "output push"]  # standardised
    amplitude: Float[np.ndarray, " output"]
    length: Float[np.ndarray, "output input"]
    noise: Float[np.ndarray, " output"]
    mean: Float[np.ndarray, " output"]
    scale: Float[np.ndarray, " output"]
    centre: Float[np.ndarray, " input"]
    width: Float[np.ndarray, " input"]
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
        weights.append(cho_solve((factor, True), values))
        unit = np.eye(len(values))
        whitening.append(solve_triangular(factor, unit, lower=True))

    def single(value: np.ndarray) -> jax.Array:
        return jnp.asarray(value, jnp.float32)

    same = ("inputs", "amplitude", "length", "noise", "mean", "scale")
    process = Process(
        weights=single(np.stack(weights)),
        whitening=single(np.stack(whitening)),
        kernel=fitted.kernel,
        **{name: single(getattr(fitted, name)) for name in same},
    )
    same = ("centre", "width", "reach", "plain")
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
    length, (factor, of) = fitted.length[output], KERNELS[fitted.kernel]
    far = np.sqrt(factor * squared_distances(one / length, other / length))
    return fitted.amplitude[output] ** 2 * of(far, np.exp)[0]


def squared_distances(
    one: Float[np.ndarray, "one input"], other: Float[np.ndarray, "other input"]
) -> Float[np.ndarray, "one other"]:
    """Return the squared distances of points, by one product of matrices."""
    sizes = np.add.outer(np.sum(one**2, axis=1), np.sum(other**2, axis=1))
    return np.maximum(sizes - 2 * one @ other.T, 0.0)


def rates_at(
    fitted: Fitted, inputs: Float[np.ndarray, "push input"]
) -> tuple[Float[np.ndarray, "push output"], Float[np.ndarray, "push output"]]:
    """Return mean and deviation of residuals, as `ResidualProcess.rates` does.

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
    return fitted.mean + fitted.scale * means, fitted.scale * deviations


def is_process(folder: Path) -> bool:
    """Return whether a folder holds a finished Gaussian process."""
    return (folder / PROCESS).is_file()


def read_process_card(folder: Path) -> ProcessCard:
    """Read the card of a Gaussian process.

    Raises:
        BadCheckpoint: damaged, out of bounds or of another format.
    """
    path = folder / PROCESS
    return read_document(path, ProcessCard, error=BadCheckpoint, remedy=_REMEDY)


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
        centre=np.empty(inputs),
        width=np.empty(inputs),
        reach=np.empty((card.disks, 2)),
        plain=np.empty((card.disks, 2)),
        kernel=card.recipe.kernel,
    )
    with jax.enable_x64(True):
        arrays = load_arrays(folder / ARRAYS, like, _REMEDY, known=card.weights)
    return jax.tree.map(np.asarray, arrays), card
