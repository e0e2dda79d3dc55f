"""Model identities: what a model is, from which its name and its label are computed."""

from typing import Literal, get_args

import msgspec

from sainet.engines.simulator import PAPER, TRUE_PROPERTIES, OwnSpec, SimulatorSpec
from sainet.runs.folders import Keyed

Kind = Literal["physics", "in", "sain", "gp", "published"]
# Pushes that a network was trained on: the paper's simulated pushes; simulated strokes;
# "simulation" is a stroke network used as it is, "tuned" one fine-tuned on recorded
# pushes; "residual" an additive network and "real" a new one, recorded pushes only.
TrainingData = Literal["paper", "stroke", "simulation", "tuned", "residual", "real"]
ModelKind = Literal["in", "sain"]  # of networks
# Beyond the paper's: "contact" is the form of contact networks, "whole-state" that of
# feedforward networks. "letter" takes the inputs of the paper's equations as they are,
# see `models.features`, as for those between it and "paper"; "nominal": the paper's, of
# assumed masses and radii.
Features = Literal[
    "paper",
    "place",
    "contact",
    "letter",
    "letter-push-frame",
    "letter-motion",
    "unbounded",
    "whole-state",
    "nominal",
]
IntegratorName = Literal["acceleration", "relaxing-residual"]
ProcessFeatures = Literal["angle", "side", "place"]  # of Gaussian processes
Variant = Literal[
    "",
    "bystander",
    "single-steps",
    "for-all",
    "ensemble",
    "one-to-four",
    "three-disks",
    "fixed-properties",
    "loss-in-metres",
    "large-l2",
    "small-l2",
    "millimetres",
    "scaled-loss",
    "chosen",
    "shorter",
]

NETWORKS = get_args(ModelKind)
LEARNED = (*NETWORKS, "gp")
_KINDS = {"physics": "Physics", "in": "IN", "sain": "SAIN", "gp": "Gaussian process"}
_ABSTAINING = "abstaining"
_FEEDFORWARD = {"in": "Feedforward", "sain": "SA feedforward"}
_VARIANTS = {
    "single-steps": "single steps",
    "for-all": "all surfaces",
    "one-to-four": "mixed",  # numbers of disks
    "letter": "by the letter",
    "letter-push-frame": "by the letter but in the push frame",
    "letter-motion": "by the letter but with relative motion",
    "unbounded": "unbounded inputs",
    "loss-in-metres": "loss in metres",
    "large-l2": "large l2",
    "small-l2": "small l2",
    "millimetres": "loss in millimetres",
    "scaled-loss": "scaled loss",
    "shorter": "shorter training",
    "three-disks": "3 disks",
    "fixed-properties": "fixed properties",
    "nominal": "nominal inputs",
}


class ModelId(Keyed, frozen=True, kw_only=True):
    """The identity of a model: equal identities name the same kind of model.

    `slug` is its name in commands, tables and JSON, `label` its name for readers. Both
    are computed from the fields and never taken apart again.
    """

    kind: Kind
    simulator: SimulatorSpec | None = None  # the engine, or a network's internal engine
    data: TrainingData = "paper"
    features: Features | ProcessFeatures = "paper"
    variant: Variant = ""
    name: str = ""  # given by a user or publication; replaces the computed names
    # Whether an engine predicts in its place on surfaces that it was not fitted to.
    abstains: Literal[True] | msgspec.UnsetType = msgspec.UNSET

    @property
    def abstaining(self) -> "ModelId":
        """The identity of the model that abstains on other surfaces."""
        name = self.name and f"{self.name}-{_ABSTAINING}"
        return msgspec.structs.replace(self, name=name, abstains=True)

    @property
    def slug(self) -> str:
        """The name in commands, tables and JSON."""
        return self.name or "-".join(filter(None, [self.kind, *self._parts()]))

    @property
    def label(self) -> str:
        """The name for readers."""
        if self.name:
            return self.name
        kinds, words = _KINDS, filter(None, self._parts()[3:])
        if self.features == "contact":  # always residuals
            words = (word for word in words if word != self.data)
        if self.features == "whole-state":
            kinds, words = _FEEDFORWARD, (w for w in words if w != self.features)
        label = kinds[self.kind] + self._engine_label()
        return ", ".join([label, *(_VARIANTS.get(word, word) for word in words)])

    def _parts(self) -> list[str]:
        """Return the parts of the slug after the kind, empty where usual."""
        return [
            *self._simulator_parts(),
            "" if self.data == "paper" else self.data,
            "" if self.features == "paper" else self.features,
            self.variant,
            _ABSTAINING if self.abstains else "",
        ]

    def _simulator_parts(self) -> tuple[str, str, str]:
        """Return the engine, its properties, and whether it keeps overlaps.

        Each is empty where usual.
        """
        if self.simulator is None or self.kind == "in":
            return "", "", ""
        if isinstance(self.simulator, OwnSpec):
            return self.simulator.name, "", ""
        # Physics is named for what it assumes, not for its engine.
        engine = self.simulator.engine
        is_usual = self.kind == "physics" or engine == "planar"
        known = {PAPER: "", TRUE_PROPERTIES: "true"}
        properties = known.get(self.simulator.assumptions, "identified")
        overlaps = "overlap" if self.simulator.chosen_as != engine else ""
        return "" if is_usual else engine, properties, overlaps

    def _engine_label(self) -> str:
        engine, properties, overlaps = self._simulator_parts()
        around = engine and f" around {engine.capitalize()}"
        kept = overlaps and ", overlaps kept"
        return around + _PROPERTIES_LABELS[properties] + kept


_PROPERTIES_LABELS = {"": "", "true": ", true properties", "identified": ", identified"}
