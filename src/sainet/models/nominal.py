"""Nominal features: a network that is given assumed masses and radii, not true ones.

They are what users have who have measured nothing. The internal engine of such a model
may still have the true properties.
"""

from dataclasses import dataclass

from sainet.engines.base import with_assumptions
from sainet.engines.simulator import PAPER
from sainet.models.features import FeatureSet
from sainet.models.inputs import PushFrame, Still, still_features
from sainet.scenes.scene import Scene


@dataclass(frozen=True)
class NominalFeatures(FeatureSet):
    """The same features of the paper's disks, whichever disks there are."""

    def still(self, scene: Scene, frame: PushFrame) -> Still:
        """Return the paper's masses and radii, in the order of the disks."""
        return still_features(with_assumptions(scene, PAPER), frame)
