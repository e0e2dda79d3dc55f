"""Documents of models: cards of networks, and identified parameters."""

from pathlib import Path
from typing import Annotated, ClassVar, Literal

import msgspec

from sainet.engines.simulator import InternalEngine
from sainet.models.identity import NETWORKS, Features, IntegratorName, ModelId
from sainet.runs.documents import read_document, read_json
from sainet.runs.errors import BadCheckpoint, BadInput
from sainet.runs.folders import CONFIG, remake
from sainet.runs.manifest import Manifest
from sainet.scenes.quantities import Finite, Size, TimeStep
from sainet.scenes.recording import AGREES, CameraOffset
from sainet.worlds.config import SetupName

CARD = "card.json"
WEIGHTS = "network.safetensors"
IDENTIFIED = "identified.json"
Decay = Literal["halving", "cosine"]  # of the learning rate
Terms = Literal["motion", "error", "metres"]
Count = Annotated[int, msgspec.Meta(ge=1)]


class TrainingSettings(msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True):
    """The settings of a recipe; its start is not one of them.

    Each has the name and the meaning of the field in `learning.recipes`. Those with a
    default are newer than some networks.
    """

    iterations: int
    batch_size: int
    learning_rate: float
    halve_every: int
    decay: Decay = "halving"
    clip_norm: float
    average: int
    l2: float | None
    weight_position: float
    weight_rotation: float
    weight_velocity: float
    weight_spin: float
    terms: Terms
    linear_from: float
    horizon: Literal["whole-push", "single-steps"]
    steps: int
    hold: int | msgspec.UnsetType = msgspec.UNSET  # single steps have none
    short_iterations: int = 0
    mirror: bool
    validation_share: float
    patience: int
    features: Features
    seed: int
    log_every: int
    checkpoint_every: int


class Card(msgspec.Struct, frozen=True, kw_only=True):
    """Metadata that restricts a network's use."""

    file: ClassVar[str] = CARD
    noun: ClassVar[str] = "network"
    made: ClassVar[str] = "trained"

    identity: ModelId
    kind: SetupName  # of the pushes
    time_step: TimeStep  # s
    truth_engine: str  # that made the training data, or `RECORDED`
    integrator: IntegratorName = "acceleration"
    camera: CameraOffset = AGREES  # of the internal engine
    data: str  # hash of the training data
    disks: Count  # in each push of the training data, at most
    counts: tuple[Count, ...] | msgspec.UnsetType = msgspec.UNSET  # several numbers
    trained_pushes: Count  # number of pushes in the training data
    data_seeds: tuple[int, ...] = ()  # of simulated training pushes not in `pushes`
    pushes: str = ""  # training pushes (`runs.digests`)
    groups: tuple[str, ...] | msgspec.UnsetType = msgspec.UNSET  # of recorded pushes
    weights: str  # hash of the weights' file
    started_from: str | None = None  # hash of the weights that training began with
    recipe: TrainingSettings
    manifest: Manifest
    final_loss: float | None = None
    format_version: Literal[3] = 3
    seal: str = ""  # hash of all other fields

    def __post_init__(self) -> None:
        """Refuse identities that no network can have."""
        kind, simulator = self.identity.kind, self.identity.simulator
        if kind not in NETWORKS:
            known = " or ".join(map(repr, NETWORKS))
            raise ValueError(f"identity.kind is {kind!r}; it must be {known}")
        if (simulator is None) != (kind == "in"):
            raise ValueError("identity.simulator is missing, or there is one for 'in'")
        if simulator is None and self.integrator != "acceleration":
            raise ValueError(
                f"integrator is {self.integrator!r}; identity.kind must then be 'sain'"
            )

    @property
    def numbers_of_disks(self) -> tuple[int, ...]:
        """The numbers of disks in the pushes of the training data."""
        return (self.disks,) if self.counts is msgspec.UNSET else self.counts

    @property
    def has_single_steps(self) -> bool:
        """Whether the network was trained on single steps (the paper's figure 2c)."""
        return self.recipe.horizon == "single-steps"

    @property
    def internal(self) -> InternalEngine | None:
        """The internal engine; None for a network without one."""
        simulator = self.identity.simulator
        return None if simulator is None else InternalEngine(simulator, self.camera)


def read_card(folder: Path) -> Card:
    """Read the card of a trained network.

    Raises:
        BadCheckpoint: it is missing, damaged, out of bounds or of another format.
    """
    path = folder / CARD
    if not folder.is_dir():
        raise BadCheckpoint(f"{folder}: no such network; make one with 'sainet train'.")
    if not path.is_file():
        raise BadCheckpoint(
            f"{path}: not found: this is no network, or its training did not finish; "
            "run the same command again to resume it."
        )
    return read_document(path, Card, error=BadCheckpoint, remedy="train it again")


_INTERNAL = ("digests", "engine", "format_version", "groups", "seal")


class Estimate(msgspec.Struct, frozen=True):
    """Estimate of one parameter."""

    name: str
    value: Finite  # the initial value where the parameter is not identifiable
    low: Finite  # of the 95 % interval
    high: Finite
    start: Finite  # initial value
    doubt: str | None = None  # why the parameter is not identifiable, if so


class Identified(msgspec.Struct, frozen=True, kw_only=True):
    """Parameters estimated from pushes, and how much they improve the engine."""

    file: ClassVar[str] = IDENTIFIED
    noun: ClassVar[str] = "engine"
    made: ClassVar[str] = "identified"

    engine: InternalEngine  # with the estimated parameters
    estimates: tuple[Estimate, ...]
    pushes: int
    before_mm: Size  # mean position error where poses were observed
    after_mm: Size
    before_deg: Size  # mean rotation error
    after_deg: Size
    digests: str = ""  # of the pushes (`runs.digests`); empty: of an earlier version
    groups: tuple[str, ...] | msgspec.UnsetType = msgspec.UNSET  # of recorded pushes
    format_version: Literal[2] = 2
    seal: str = ""  # hash of all other fields

    def to_json(self) -> dict[str, object]:
        """Return the estimates as JSON values, sorted by name."""
        found = msgspec.to_builtins(self, order="sorted") | {"values": self.values}
        return {name: found[name] for name in sorted(found) if name not in _INTERNAL}

    @property
    def values(self) -> dict[str, float]:
        """The estimated values by the names of their parameters."""
        pairs = sorted((estimate.name, estimate.value) for estimate in self.estimates)
        return dict(pairs)


def is_identified(folder: Path) -> bool:
    """Return whether a folder is from `sainet identify`, finished or not."""
    try:
        if (folder / IDENTIFIED).is_file():
            return True
        return read_json(folder / CONFIG).get("command") == "identify"
    except (BadInput, OSError):  # missing or damaged: reading it raises the error
        return False


def read_identified(folder: Path) -> Identified:
    """Return the parameters that `sainet identify` estimated.

    Raises:
        BadInput: the file is missing, damaged or out of bounds.
    """
    path = folder / IDENTIFIED
    if not path.is_file():
        raise BadInput(
            f"{path}: missing, so the identification is unfinished; run the same "
            "'sainet identify' again."
        )
    return read_document(path, Identified, remedy=remake(folder))
