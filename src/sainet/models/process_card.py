"""Gaussian processes on disk: their card, beside a file of arrays."""

from pathlib import Path
from typing import Annotated, ClassVar, Literal, get_args

import msgspec

from sainet.engines.simulator import InternalEngine
from sainet.models.card import Count
from sainet.models.correctors.kernels import KERNELS, KernelName
from sainet.models.correctors.process import BODIES
from sainet.models.identity import ModelId, ProcessFeatures
from sainet.runs.documents import read_document
from sainet.runs.errors import BadCheckpoint
from sainet.runs.manifest import Manifest
from sainet.scenes.quantities import LARGEST_SEED, TimeStep
from sainet.scenes.recording import AGREES, CameraOffset

PROCESS = "process.json"
ARRAYS = "process.safetensors"
REMEDY = "fit it again"
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
    seed: Annotated[int, msgspec.Meta(ge=0, le=LARGEST_SEED)] = 0
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
    format_version: Literal[3] = 3

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


def is_process(folder: Path) -> bool:
    """Return whether a folder holds a finished Gaussian process."""
    return (folder / PROCESS).is_file()


def read_process_card(folder: Path) -> ProcessCard:
    """Read the card of a Gaussian process.

    Raises:
        BadCheckpoint: missing, damaged, out of bounds or of another format.
    """
    path = folder / PROCESS
    if not path.is_file():
        raise BadCheckpoint(f"{folder}: not a Gaussian process of 'sainet tune gp'.")
    return read_document(path, ProcessCard, error=BadCheckpoint, remedy=REMEDY)
