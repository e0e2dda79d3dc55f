"""The models that are compared on recorded pushes, and how each comes to be."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np
from jaxtyping import Int

from sainet.datasets.store import Store
from sainet.identification.identify import identify_into
from sainet.learning.recipes import (
    FINE_TUNING,
    RESIDUAL,
    Features,
    Fresh,
    FromModel,
    ModelKind,
)
from sainet.models.card import read_identified
from sainet.models.checkpoint import load_network
from sainet.models.dynamics import SimulatorAugmented
from sainet.models.identity import identity_named
from sainet.models.library import Model, load_model, network_folder
from sainet.models.wrappers import with_camera
from sainet.studies.chain import Chain
from sainet.studies.config import Scale
from sainet.studies.trainings import scaled

Inside = Literal["nominal", "identified"]  # the engine in SAIN
Learned = Literal["simulation", "tuned", "residual", "real"]
_STROKES = {"in": "in-stroke", "sain": "sain-stroke"}  # shipped, of simulated strokes


@dataclass(frozen=True)
class Variant:
    """A network, what it knows, and what of.

    Simulation: of strokes that the nominal engine made, and nothing else. The others
    learn recorded pushes. Tuned: begins with the network of simulation. Residual: adds
    to the engine, and nothing at first. Real: begins with nothing, in the paper's form.
    """

    network: ModelKind
    learned: Learned
    engine: Inside = "nominal"
    features: Features = "paper"

    @property
    def name(self) -> str:
        """What tables and folders call it."""
        parts = [
            self.network,
            "identified" if self.engine == "identified" else "",
            self.learned,
            "place" if self.features == "place" else "",
        ]
        return "-".join(part for part in parts if part)


def surfaces_of(store: Store) -> dict[str, Int[np.ndarray, " some"]]:
    """Return the pushes on each surface; a group is surface and speed: ``abs-10``."""
    known = [name.rpartition("-")[0] or name for name in store.info.groups]
    groups = known or ["recorded"]
    owner = np.array(groups)[store.read(slice(None), ("group",))["group"]]
    return {name: np.flatnonzero(owner == name) for name in dict.fromkeys(groups)}


@dataclass(frozen=True)
class Tuner:
    """Makes models of some training pushes, each in a folder of its own, once."""

    training: Store
    folder: str  # in that of the chain
    scale: Scale
    chain: Chain

    def physics(self) -> list[Model]:
        """Return the engine as it is and with parameters identified on the pushes."""
        identified = load_model(str(self._identified()))
        return [
            load_model("physics"),
            replace(identified, id=identity_named("physics-identified")),
        ]

    def models(self, variants: Sequence[Variant]) -> list[Model]:
        """Return networks, trained where they are to be."""
        return [
            replace(self._model(each), id=identity_named(each.name))
            for each in variants
        ]

    def _model(self, variant: Variant) -> Model:
        strokes, is_identified = _STROKES[variant.network], variant.engine != "nominal"
        if variant.learned == "simulation":
            found = load_model(strokes)
            return self._around_identified(found) if is_identified else found
        recipe = {
            "tuned": FINE_TUNING.changed(start=FromModel(strokes)),
            "residual": RESIDUAL,
            "real": FINE_TUNING.changed(start=Fresh()),
        }[variant.learned].changed(features=variant.features)
        result = self.chain.train(
            variant.network,
            self.training,
            scaled(recipe, self.scale, self.training.info.pushes),
            name=f"{self.folder}/{variant.name}",
            assumed_engine=str(self._identified()) if is_identified else "planar",
        )
        return load_model(str(result.folder))

    def _around_identified(self, model: Model) -> Model:
        """Return a network around another engine than it was trained around."""
        network = load_network(network_folder(model.name))[0]
        internal = read_identified(self._identified()).engine
        around = SimulatorAugmented(network, internal.simulator.build())
        return replace(model, dynamics=with_camera(around, internal.camera))

    def _identified(self) -> Path:
        """Return the folder of the engine with what the training pushes tell of it."""
        folder = self.chain.out / self.folder / "identified"
        identify_into(self.training, folder)
        return folder
