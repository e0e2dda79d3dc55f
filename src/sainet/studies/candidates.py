"""Models that a cross-validation compares: each learns what the engine gets wrong."""

import abc
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType

from msgspec import structs

from sainet.datasets.store import Store
from sainet.engines.simulator import InternalEngine
from sainet.learning.ensemble import divided, fit_ensemble
from sainet.learning.fit import fit
from sainet.learning.process import check_store, fit_process
from sainet.learning.recipes import RESIDUAL, Recipe
from sainet.models.identity import ModelId, ProcessFeatures
from sainet.models.process_card import ProcessSettings
from sainet.runs.errors import unknown_name
from sainet.studies import MEMBERS, CandidateName, Scale
from sainet.studies.recorded_models import IDENTIFIED, Variant


@dataclass(frozen=True)
class Candidate(abc.ABC):
    """A model that learns what the identified engine gets wrong."""

    @property
    @abc.abstractmethod
    def identity(self) -> ModelId:
        """The identity in tables."""

    @abc.abstractmethod
    def check(self, store: Store) -> None:
        """Raise `BadStore` if the model cannot be fitted to pushes."""

    @abc.abstractmethod
    def fit(self, store: Store, internal: InternalEngine, folder: Path) -> None:
        """Fit the model to pushes, around an engine, unless the folder has it."""


@dataclass(frozen=True)
class ProcessCandidate(Candidate):
    """A Gaussian process."""

    features: ProcessFeatures

    @property
    def identity(self) -> ModelId:
        """The identity in tables."""
        return ModelId(kind="gp", simulator=IDENTIFIED, features=self.features)

    @property
    def settings(self) -> ProcessSettings:
        """How it is fitted."""
        return ProcessSettings(features=self.features)

    def check(self, store: Store) -> None:
        """Refuse too few pushes, too many disks, and inputs that do not vary."""
        check_store(store, self.settings)

    def fit(self, store: Store, internal: InternalEngine, folder: Path) -> None:
        """Fit the process."""
        fit_process(store, folder, internal, self.settings)


@dataclass(frozen=True)
class ChosenProcess(ProcessCandidate):
    """A Gaussian process whose inputs and kernel are chosen on its pushes.

    Its features are the most that it may have.
    """

    @property
    def identity(self) -> ModelId:
        """The identity in tables."""
        return structs.replace(super().identity, variant="chosen")

    @property
    def settings(self) -> ProcessSettings:
        """How it is fitted."""
        return structs.replace(super().settings, choose=True)


@dataclass(frozen=True)
class NetworkCandidate(Candidate):
    """A network that learns from the pushes, alone or around an engine."""

    variant: Variant
    scale: Scale = "paper"

    @property
    def identity(self) -> ModelId:
        """The identity in tables."""
        return self.variant.identity()

    def check(self, store: Store) -> None:
        """Accept all pushes that an engine can be identified on."""

    def fit(self, store: Store, internal: InternalEngine, folder: Path) -> None:
        """Train the network."""
        is_around = self.variant.engine == "identified"
        fit(
            self.variant.network,
            store,
            self.recipe(store.info.pushes),
            folder,
            engine=internal if is_around else "planar",
        )

    def recipe(self, pushes: int) -> Recipe:
        """Return the recipe for so many pushes."""
        return self.variant.recipe(self.scale, pushes)


@dataclass(frozen=True)
class EnsembleCandidate(NetworkCandidate):
    """Additive networks around the engine, whose disagreement gives regions."""

    @property
    def identity(self) -> ModelId:
        """The identity in tables."""
        return structs.replace(super().identity, variant="ensemble")

    def check(self, store: Store) -> None:
        """Refuse too few pushes to calibrate the regions."""
        divided(store, RESIDUAL.seed)

    def fit(self, store: Store, internal: InternalEngine, folder: Path) -> None:
        """Train the networks and calibrate them."""
        recipe = self.recipe(store.info.pushes)
        fit_ensemble("sain", store, recipe, folder, members=MEMBERS, engine=internal)


ADDITIVE = Variant("sain", "residual", "identified")
WITH_PLACE = replace(ADDITIVE, features="place")


# From the simplest to the one that needs most: the same table and the same disk.
CANDIDATES: Mapping[CandidateName, Candidate] = MappingProxyType(
    {
        "gp-angle": ProcessCandidate("angle"),
        "sain": NetworkCandidate(ADDITIVE),
        "sain-ensemble": EnsembleCandidate(ADDITIVE),
        "gp-side": ProcessCandidate("side"),
        "gp-side-chosen": ChosenProcess("side"),
        "sain-place": NetworkCandidate(WITH_PLACE),
        "sain-place-ensemble": EnsembleCandidate(WITH_PLACE),
        "gp-place": ProcessCandidate("place"),
        "gp-place-chosen": ChosenProcess("place"),
    }
)


def candidates_named(names: Sequence[str]) -> tuple[Candidate, ...]:
    """Return candidates, from the simplest.

    Raises:
        UnknownName: there is no candidate of a name.
    """
    for name in names:
        if name not in CANDIDATES:
            raise unknown_name("candidate", name, CANDIDATES)
    return tuple(each for name, each in CANDIDATES.items() if name in names)
