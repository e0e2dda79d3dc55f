"""The models that are compared on recorded pushes, and how each is made."""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from jaxtyping import Int

from sainet.datasets.groups import surface_of
from sainet.datasets.store import Store
from sainet.engines.simulator import SIMULATORS, Assumptions, PlanarSpec
from sainet.learning.recipes import FINE_TUNING, RESIDUAL, Fresh, FromModel, Recipe
from sainet.models.card import read_identified
from sainet.models.checkpoint import load_network
from sainet.models.dynamics import SimulatorAugmented
from sainet.models.identity import Features, ModelId, ModelKind
from sainet.models.identity import Variant as Made
from sainet.models.library import load_model, network_folder
from sainet.models.model import Model
from sainet.models.wrappers import with_camera
from sainet.studies import Scale
from sainet.studies.paper_setup import physics, scaled
from sainet.studies.runner import Runner
from sainet.studies.steps import Given, Identify, Load, Step, Train

Inside = Literal["nominal", "identified"]  # the engine in SAIN
Learned = Literal["simulation", "tuned", "residual", "real"]
# In identities: every training set has its own identified parameters.
IDENTIFIED = PlanarSpec(assumptions=Assumptions(table_friction=0.15, mass=(1.0,)))
_LONG_PUSHES = {"in": "in-stroke", "sain": "sain-stroke"}  # shipped networks


@dataclass(frozen=True)
class Variant:
    """A network, its training, its internal engine and its features.

    Simulation: trained only on long pushes that the nominal engine simulated. The
    others train on recorded pushes. Tuned: starts from the network of simulation.
    Residual: an additive network. Real: starts with random weights, in the paper's
    form.
    """

    network: ModelKind
    learned: Learned
    engine: Inside = "nominal"
    features: Features = "paper"

    def identity(self, variant: Made = "") -> ModelId:
        """Return the identity in tables."""
        inside = SIMULATORS["planar"] if self.engine == "nominal" else IDENTIFIED
        return ModelId(
            kind=self.network,
            simulator=None if self.network == "in" else inside,
            data=self.learned,
            features=self.features,
            variant=variant,
        )

    @property
    def shipped(self) -> str:
        """The name of the network that was trained on simulated long pushes."""
        return _LONG_PUSHES[self.network]

    def recipe(self, scale: Scale, pushes: int) -> Recipe:
        """Return the recipe for so many pushes."""
        recipes = {
            "tuned": FINE_TUNING.changed(start=FromModel(self.shipped)),
            "residual": RESIDUAL,
            "real": FINE_TUNING.changed(start=Fresh()),
        }
        recipe = recipes[self.learned].changed(features=self.features)
        return scaled(recipe, scale, pushes)


def surfaces_of(store: Store) -> dict[str, Int[np.ndarray, " some"]]:
    """Return the pushes on each surface."""
    groups = [surface_of(name) for name in store.info.groups] or ["recorded"]
    owner = np.array(groups)[store.read(slice(None), ("group",))["group"]]
    present = set(owner.tolist())
    names = (name for name in dict.fromkeys(groups) if name in present)
    return {name: np.flatnonzero(owner == name) for name in names}


class AroundIdentified(Step[Model]):
    """A shipped network around another engine than it was trained around."""

    id: ModelId
    network: str
    identified: Identify

    def run(self, runner: Runner) -> Model:
        """Return the model."""
        network = load_network(network_folder(self.network))[0]
        internal = read_identified(runner.folder(self.identified)).engine
        around = SimulatorAugmented(network, internal.simulator.build())
        dynamics = with_camera(around, internal.camera)
        found = load_model(self.network)
        return replace(found, id=self.id, dynamics=dynamics, internal=internal)


class TunedModels:
    """The models that can be made of some training pushes."""

    def __init__(self, training: Store, scale: Scale) -> None:
        """Identify the engine on the same pushes."""
        self._scale: Scale = scale
        self._pushes = Given(training)
        identity = ModelId(kind="physics", simulator=IDENTIFIED)
        self.identified = Identify(identity, self._pushes)

    def physics(self) -> tuple[Step[Model], Step[Model]]:
        """Return the engine as it is and with parameters identified on the pushes."""
        return physics()[0], self.identified

    def model(self, variant: Variant, made: Made = "") -> Step[Model]:
        """Return a network, trained where it is to be."""
        shipped, identity = variant.shipped, variant.identity(made)
        is_identified = variant.engine == "identified"
        if variant.learned == "simulation" and is_identified:
            return AroundIdentified(identity, shipped, self.identified)
        if variant.learned == "simulation":
            return Load(identity, shipped)
        return Train(
            identity,
            self._pushes,
            variant.recipe(self._scale, self._pushes.store.info.pushes),
            self.identified if is_identified else None,
        )
